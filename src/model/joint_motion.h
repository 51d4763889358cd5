// How a joint moves its child. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "lockstep/model.h"

namespace lockstep {

/// From the child's frame to the joint's, at Joint::position. Of a joint that is fixed or a tendon at 0: none.
inline Eigen::Isometry3d motion_of(const Joint& joint) {
  const Eigen::Vector3d axis = joint.axis.normalized();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (joint.kind == JointKind::prismatic)
    motion.translation() = joint.position * axis;
  else
    motion.linear() = Eigen::AngleAxisd(joint.position, axis).toRotationMatrix();
  return motion;
}

}  // namespace lockstep
