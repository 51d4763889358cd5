// Hulls of fewer corners. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/hull.h"

namespace lockstep::importer {

/// Of the corners of a hull at most so many, at least 4. Each next one is the corner that lies farthest outside of
/// those before it.
Hull reduced(const Hull& whole, int most_corners);

/// How far the point lies outside of the hull, m; 0 within.
double distance_outside(const Hull& hull, const Eigen::Vector3d& point);

}  // namespace lockstep::importer
