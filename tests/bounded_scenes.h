// The scenes with every kind of bound at once. SPDX-License-Identifier: Apache-2.0
//
// The bounds are tight enough that scatter() of contract.h makes different ones active: some environments are beyond a
// range, some at a velocity or effort limit, some held by friction, and their neighbours are free.
#pragma once

#include <vector>

#include "contract.h"

namespace lockstep::contract {

constexpr int limited_coupling = 2;            ///< has a force limit
constexpr int hard_drive = 5, soft_drive = 6;  ///< joints with a kinematic drive

/// Gives joint `i` bounds, one kind after the other. Nothing stops a large effort on joint 3 or the servo of joint 0,
/// because the tests cause faults with these.
inline void bound(Joint& joint, int i) {
  const auto range = [&](Softness softness) {
    joint.lower = joint.position - 0.1, joint.upper = joint.position + 0.12;
    joint.limit_softness = softness;
  };
  const auto servo = [&](double most) {
    if (joint.drive.kp == 0.0) joint.drive.kp = 20.0, joint.drive.kd = 1.0;
    joint.effort_limit = most;
  };
  switch (i % 8) {
    case 0:
      range(Hard{});
      joint.restitution = 0.5;
      servo(4.0);
      break;
    case 1:
      range(Spring{60.0, 1.0});
      joint.friction = 0.1;
      break;
    case 2:
      range(Hard{0.5});
      joint.velocity_limit = 0.6;
      break;
    case 3:
      range(ErpCfm{0.3, 0.5});
      joint.friction = 0.02;
      break;
    case 4:
      range(Frequency{20.0, 0.7});
      servo(1.0);
      break;
    case 5: joint.friction = 0.05; break;
    case 6: range(Hard{}); break;
    default: range(Hard{}); joint.velocity_limit = 0.8;
  }
}

/// The model with these bounds, two kinematic drives and a force limit.
inline Model bounded(Model model) {
  model.name = "bounded " + model.name;
  for (std::size_t j = 0; j < model.joints.size(); ++j) bound(model.joints[j], static_cast<int>(j));
  const auto prescribe = [&](int j, Softness softness) {
    Joint& joint = model.joints[static_cast<std::size_t>(j)];
    joint.drive = {};
    joint.drive.position_target = joint.position;
    joint.drive.kinematic = true, joint.drive.softness = softness;
  };
  prescribe(hard_drive, Hard{0.05});  // scattered targets are up to 0.5 away
  prescribe(soft_drive, Spring{30.0, 1.0});
  const bool fingers = model.couplings[limited_coupling].joint == "j10";  // fingers are light
  model.couplings[limited_coupling].force_limit = fingers ? 0.6 : 2.0;
  return model;
}

inline std::vector<Model> small_bounded_scenes() { return {bounded(scenes::chain8()), bounded(scenes::gripper13())}; }

/// These and chain32, which floats and takes long.
inline std::vector<Model> bounded_scenes() {
  std::vector<Model> all = small_bounded_scenes();
  all.push_back(bounded(scenes::chain32()));
  return all;
}

}  // namespace lockstep::contract
