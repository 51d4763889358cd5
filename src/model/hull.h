// Convex hulls of points, by qhull. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
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

/// Throws std::invalid_argument, whose text says what is wrong with the points: fewer than four, one that is not
/// finite, or all within a millionth of their size from a plane.
Hull hull_of(const Eigen::Matrix3Xd& points);

/// Of density 1.
Inertia solid_of(const Hull& hull);

}  // namespace lockstep
