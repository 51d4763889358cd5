// Inertia at the joints of the drawn pose. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene.h"

namespace lockstep::importer::mjcf {

// By joint of the scene, with armatures and without couplings, kg m^2 or kg; NaN for free and ball joints.

/// All other joints are locked: the diagonal of the mass matrix.
std::vector<double> locked_inertia(const Scene& scene);
/// All other joints are free: one over the diagonal of the inverse, MuJoCo's dof_invweight0. Not above 0 or NaN where
/// the matrix is singular.
std::vector<double> free_inertia(const Scene& scene);

}  // namespace lockstep::importer::mjcf
