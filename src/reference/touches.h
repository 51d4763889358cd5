// Where two shapes touch, from the shapes' definitions. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/model.h"

namespace lockstep::reference {

struct Solid {
  const Collider* collider;
  int link;  // -1: in the world
  Eigen::Isometry3d pose;
};

/// The normal points from the first to the second, the point is in the middle of the gap.
struct Touch {
  Eigen::Vector3d point, normal;
  double gap;
};

/// The first in the order of ShapeKind: half-spaces with all, spheres with all. Throws std::logic_error for others.
std::vector<Touch> touches_of(const Solid& a, const Solid& b);

}  // namespace lockstep::reference
