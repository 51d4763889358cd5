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

/// The shortest turn from one direction to another, of any lengths above 0; of opposite ones, one of many. Eigen has
/// it by a singular value decomposition, which takes ten seconds to compile.
inline Eigen::Quaterniond shortest_turn(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const double cosine = a.dot(b);
  if (cosine < -1.0 + 1e-12) return Eigen::Quaterniond(Eigen::AngleAxisd(EIGEN_PI, a.unitOrthogonal()));
  Eigen::Quaterniond turn;
  turn.w() = 1.0 + cosine, turn.vec() = a.cross(b);
  return turn.normalized();
}

}  // namespace lockstep
