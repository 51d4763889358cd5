// Solid primitives: volumes and second moments. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep::importer {

// Of density 1 about their centres, in m; the mass is the volume.
Inertia solid_cylinder(double radius, double length);  ///< about z
Inertia solid_capsule(double radius, double length);   ///< a cylinder about z between two halves of a ball
Inertia solid_ellipsoid(const Eigen::Vector3d& semi_axes);

}  // namespace lockstep::importer
