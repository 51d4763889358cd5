// Rotations as URDF has them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace lockstep::exporter::urdf {

/// Roll, pitch, yaw about fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll). What a nearly vertical x axis leaves of the yaw
/// is rounding; the roll makes up for it.
inline Eigen::Vector3d rpy_of(const Eigen::Matrix3d& r) {
  const double yaw = std::atan2(r(1, 0), r(0, 0)), c = std::cos(yaw), s = std::sin(yaw);
  return {std::atan2(s * r(0, 2) - c * r(1, 2), c * r(1, 1) - s * r(0, 1)),
          std::atan2(-r(2, 0), c * r(0, 0) + s * r(1, 0)), yaw};
}

}  // namespace lockstep::exporter::urdf
