// How a joint moves its child. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "lockstep/model.h"
#include "rotations.h"

namespace lockstep {

/// Of a joint of kind ball: 0, 1, 2 for x, y, z.
inline int part_of_ball(const Joint& joint) { return joint.axis.y() != 0.0 ? 1 : joint.axis.z() != 0.0 ? 2 : 0; }

/// Whether it follows another part of the same ball.
inline bool is_inner_part(const Joint& joint) { return joint.kind == JointKind::ball && part_of_ball(joint) > 0; }

/// The name that a ball was made with, from its first part.
inline std::string ball_name(const Joint& first) {
  return first.name.ends_with(".x") ? first.name.substr(0, first.name.size() - 2) : first.name;
}

/// From the child's frame to the joint's, where `position(j)` is that of joint j. The first part of a ball makes all of
/// its turn. Of a joint that is fixed or a tendon: none.
template <class Position>
Eigen::Isometry3d motion_of(const Model& model, int j, const Position& position) {
  const Joint& joint = model.joints[static_cast<std::size_t>(j)];
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  switch (joint.kind) {
    case JointKind::fixed:
    case JointKind::tendon: break;
    case JointKind::prismatic: motion.translation() = position(j) * joint.axis.normalized(); break;
    case JointKind::ball:
      if (part_of_ball(joint) == 0)
        motion.linear() = turned_by({position(j), position(j + 1), position(j + 2)}).toRotationMatrix();
      break;
    default: motion.linear() = Eigen::AngleAxisd(position(j), joint.axis.normalized()).toRotationMatrix();
  }
  return motion;
}

/// The same at Joint::position.
inline Eigen::Isometry3d motion_of(const Model& model, int j) {
  return motion_of(model, j, [&](int at) { return model.joints[static_cast<std::size_t>(at)].position; });
}

}  // namespace lockstep
