// Where a Model starts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <string>
#include <vector>

#include "scene.h"

namespace lockstep::importer::mjcf {

struct Start {
  std::vector<double> position, velocity;  ///< by joint of the scene; 0 for free joints
  std::vector<double> control;             ///< by actuator; empty without controls: servos hold the start
  std::map<int, Eigen::Isometry3d> pose;   ///< by body with a free joint, and by mocap body
  std::map<int, Twist> twist;              ///< by body with a free joint, in the body's axes, angular first
};

/// A keyframe.
struct Key {
  std::string name;  ///< its number from 0 if it has none
  Start start;
  bool is_chosen = false;  ///< by ImportOptions::keyframe
};

/// The keyframes, in order. Those that do not fit the model are warnings. Throws SettingsError where that of the
/// options does not exist, ImportError where it does not fit.
std::vector<Key> read_keys(const Scene& scene);

/// The drawn pose, or the keyframe that is chosen.
Start start_of(const Scene& scene, const std::vector<Key>& keys);

}  // namespace lockstep::importer::mjcf
