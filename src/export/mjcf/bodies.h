// Which link becomes which body. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "inertials.h"

namespace lockstep::exporter::mjcf {

struct JointPlace {
  int joint;
  Eigen::Isometry3d pose;  ///< of the joint's frame in its body's, where all joints are at 0
};

struct Body {
  std::string name;
  int link = 0;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< in the parent's frame, where all joints are at 0
  std::vector<JointPlace> joints = {};                     ///< the outermost first
  bool floats = false;
  Inertial inertial = {};
  std::vector<int> children = {};
};

/// MuJoCo's bodies. A link without mass between two joints has none: the next body has both joints.
struct Layout {
  std::vector<Body> bodies;    ///< in MuJoCo's order
  std::vector<int> in_world;   ///< the bodies that the world carries
  std::vector<bool> is_world;  ///< by link: its frame is the world's
};

/// A root that is the world and no body in it.
bool stands_for_world(const Root& root, const Model& model);

Layout lay_out(const Model& model, const Trees& trees, Report& report);

}  // namespace lockstep::exporter::mjcf
