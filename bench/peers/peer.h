// Peer: an engine with its settings that steps environments of a Model. SPDX-License-Identifier: Apache-2.0
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
  virtual void step() = 0;                                       ///< all environments, in any order
  virtual Eigen::VectorXd positions() const = 0;                 ///< of the first environment's joints
  virtual bool failed() const { return false; }                  ///< true if the engine reports that it diverged

  /// The times at which a step reads targets, as shares of the step. Most engines hold the targets of its start.
  virtual std::vector<double> target_times() const { return {0.0}; }
  /// Sets the targets of target_times()[time].
  virtual void set_targets_at(int, const Eigen::VectorXd& targets) { set_targets(targets); }
  /// The state of the first environment, for energy and momentum. Empty if the engine does not give it.
  virtual std::optional<reference::State> state() const { return std::nullopt; }
};

/// An engine with settings, to be measured.
struct Contender {
  std::string engine;
  std::string settings;
  int steps_per_call = 1;  ///< steps of one Peer::step(), with the same targets
  bool exact = true;       ///< couplings are meant to hold, so that small steps lead to the exact motion
  int environments = 16;   ///< as many as it is fastest with, or 1 if a motion takes seconds
  std::function<std::unique_ptr<Peer>(const Model&, double dt, int environments)> make = {};
};

/// Throws std::invalid_argument for a model that not all peers can express. Allowed are bodies with principal axes
/// along those of the link, revolute joints, hard mimics of one joint, and servos without velocity targets.
void require_plain(const Model& model);

/// The one root of such a model.
Root root_of(const Model& model);

/// Index in Model::joints of the joint that moves the link; -1 for the root.
int joint_of_link(const Model& model, const std::string& link);

std::vector<Contender> own_contenders();
/// Integrators, precisions and sweeps by the engine tables, with one step per call and targets for each stage.
std::vector<Contender> own_integrators();
std::vector<Contender> mujoco_contenders();
std::vector<Contender> bullet_contenders();
std::vector<Contender> simbody_contenders();

/// Position targets at a time, by dof.
using TargetsOverTime = std::function<Eigen::VectorXd(double t)>;
/// Simbody's error-controlled motion. step() advances by `interval`, in as many steps as the accuracy needs. The servos
/// follow `targets` within these steps too; set_targets() does nothing.
std::unique_ptr<Peer> simbody_motion(const Model& model, double interval, const TargetsOverTime& targets,
                                     double accuracy);

}  // namespace lockstep::peers
