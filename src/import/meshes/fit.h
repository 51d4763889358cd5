// Shapes around hulls. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "lockstep/import.h"
#include "model/hull.h"

namespace lockstep::importer {

/// A shape, and its pose in the frame of the mesh.
struct Fitted {
  Shape shape;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  int corners = 0;      ///< of a hull
  double inside = 0.0;  ///< m: how far the farthest corner of the whole hull stands out of the shape
};

/// `fit` is not none. A box or capsule encloses the hull, along its principal axes.
Fitted fitted(const Hull& hull, Fit fit, int most_corners);

}  // namespace lockstep::importer
