// Where a Model starts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <vector>

#include "scene.h"

namespace lockstep::importer::mjcf {

struct Start {
  std::vector<double> position, velocity;  ///< by joint of the scene; 0 for free and ball joints
  std::vector<double> control;             ///< by actuator; empty without controls: servos hold the start
  std::map<int, Eigen::Isometry3d> pose;   ///< by body with a free joint, and by mocap body
  std::map<int, Twist> twist;              ///< by body with a free joint, in the body's axes, angular first
};

/// The drawn pose, or the keyframe of the options. Throws SettingsError where there is none, ImportError where its
/// numbers do not fit the model.
Start read_start(const Scene& scene);

}  // namespace lockstep::importer::mjcf
