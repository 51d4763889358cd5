// Peer: an engine with settings of its own, stepping environments of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "lockstep/model.h"
#include "reference/mechanism.h"

namespace lockstep::peers {

class Peer {
 public:
  virtual ~Peer() = default;

  virtual void reset() = 0;                                      ///< all environments to the model's state
  virtual void set_targets(const Eigen::VectorXd& targets) = 0;  ///< of the servos, by dof, in all environments
  virtual void step() = 0;                        ///< all environments, one after the other or however the engine likes
  virtual Eigen::VectorXd positions() const = 0;  ///< of the first environment's joints
  virtual bool failed() const { return false; }   ///< the engine itself has noticed that its state is lost

  /// When in a step it looks at targets, as shares of the step; most engines hold what they have at its start.
  virtual std::vector<double> target_times() const { return {0.0}; }
  /// Those of target_times()[time].
  virtual void set_targets_at(int, const Eigen::VectorXd& targets) { set_targets(targets); }
  /// Of the first environment, where the engine tells: for energy and momentum.
  virtual std::optional<reference::State> state() const { return std::nullopt; }
};

/// What is measured: an engine with settings.
struct Contender {
  std::string engine;
  std::string settings;
  int steps_per_call = 1;  ///< steps that Peer::step() makes, targets held
  bool exact = true;       ///< its couplings are meant to hold, so with small steps it comes to the exact motion
  int environments = 16;   ///< as many as it is fastest with, or 1 where a motion takes seconds
  std::function<std::unique_ptr<Peer>(const Model&, double dt, int environments)> make = {};
};

/// Refuses models that converters have no words for: only bodies with their principal axes along the link's, revolute
/// joints, hard mimics of one joint, and servos without velocity targets are compared.
void require_plain(const Model& model);

/// Place in Model::joints of the joint that moves the link; -1 for the root.
int joint_of_link(const Model& model, const std::string& link);

std::vector<Contender> own_contenders();
/// Integrators, precisions and sweeps by tables, one step a call; targets of each stage where there are several.
std::vector<Contender> own_integrators();
std::vector<Contender> mujoco_contenders();
std::vector<Contender> bullet_contenders();
std::vector<Contender> simbody_contenders();

/// Position targets at a time, by dof.
using TargetsOverTime = std::function<Eigen::VectorXd(double t)>;
/// Simbody's error-controlled motion, whose servos follow the targets within a step too (set_targets() does nothing):
/// step() goes on by `interval`, in as many steps as the accuracy asks for.
std::unique_ptr<Peer> simbody_motion(const Model& model, double interval, const TargetsOverTime& targets,
                                     double accuracy);

}  // namespace lockstep::peers
