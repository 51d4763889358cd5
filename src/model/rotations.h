// Rotations as vectors of angles, and back. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace lockstep {

/// Axis times angle, rad, up to pi.
inline Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& turn) {
  const double sine = turn.vec().norm();
  if (sine == 0.0) return Eigen::Vector3d::Zero();
  return 2.0 * std::atan2(turn.w() < 0.0 ? -sine : sine, std::abs(turn.w())) / sine * turn.vec();
}

inline Eigen::Quaterniond turned_by(const Eigen::Vector3d& angle) {
  const double size = angle.norm();
  if (size == 0.0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(size, angle / size));
}

}  // namespace lockstep
