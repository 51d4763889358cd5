// Peer: an engine with settings of its own, stepping environments of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::peers {

class Peer {
 public:
  virtual ~Peer() = default;

  virtual void reset() = 0;  ///< all environments to the model's state
  virtual void set_targets(const Eigen::VectorXd& targets) = 0;  ///< of the servos, by dof, in all environments
  virtual void step() = 0;   ///< all environments, one after the other or however the engine likes
  virtual Eigen::VectorXd positions() const = 0;  ///< of the first environment's joints
  virtual bool failed() const { return false; }   ///< the engine itself has noticed that its state is lost
};

/// What is measured: an engine with settings.
struct Contender {
  std::string engine;
  std::string settings;
  int steps_per_call = 1;  ///< steps that Peer::step() makes, targets held
  bool exact = true;       ///< its couplings are meant to hold, so with small steps it comes to the exact motion
  int environments = 256;  ///< fewer where each takes so long that they are no matter
  std::function<std::unique_ptr<Peer>(const Model&, double dt, int environments)> make = {};
};

/// Refuses models that converters have no words for: only bodies with their principal axes along the link's, revolute
/// joints, hard mimics of one joint, and servos without velocity targets are compared.
void require_plain(const Model& model);

/// Place in Model::joints of the joint that moves the link; -1 for the root.
int joint_of_link(const Model& model, const std::string& link);

std::vector<Contender> own_contenders();
std::vector<Contender> mujoco_contenders();
std::vector<Contender> bullet_contenders();
std::vector<Contender> simbody_contenders();

}  // namespace lockstep::peers
