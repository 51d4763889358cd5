// Convex hulls of points, by qhull. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

constexpr int most_hull_corners = 64;

struct HullFace {
  Eigen::Vector3d normal;    ///< outwards, length 1
  std::vector<int> corners;  ///< to the left about the normal
};

/// A convex polytope. Faces that lie in one plane to a millionth of its size are one face.
struct Hull {
  Eigen::Matrix3Xd corners;
  std::vector<HullFace> faces;
};

/// Numbers of four points that span a solid: the first, the farthest from it, from their line and from their plane.
/// Throws as hull_of().
std::array<Eigen::Index, 4> points_apart(const Eigen::Matrix3Xd& points);

/// Throws std::invalid_argument, whose text says what is wrong with the points: fewer than four, one that is not
/// finite, or all within a millionth of their size from a plane.
Hull hull_of(const Eigen::Matrix3Xd& points);

/// Of density 1.
Inertia solid_of(const Hull& hull);

/// Adds up tetrahedra of density 1 between an apex and triangles.
class TetrahedronSum {
 public:
  explicit TetrahedronSum(const Eigen::Vector3d& apex) : apex_(apex) {}
  /// The columns are corners. The volume is below 0 where they are to the right as seen from outside, unless it is
  /// absolute.
  void add(const Eigen::Matrix3d& triangle, bool is_absolute = false);
  double volume() const { return volume_; }
  Inertia inertia() const;  ///< of all together; the volume must not be 0
  Eigen::Matrix3d about_apex() const { return second_.trace() * Eigen::Matrix3d::Identity() - second_; }

 private:
  Eigen::Vector3d apex_;
  double volume_ = 0.0;
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero();  // moments about the apex
  Eigen::Matrix3d second_ = Eigen::Matrix3d::Zero();
};

}  // namespace lockstep
