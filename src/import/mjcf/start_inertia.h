// Inertia at the joints and bodies of the drawn pose. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene.h"

namespace lockstep::importer::mjcf {

// By joint of the scene, with armatures and without couplings, kg m^2 or kg; NaN for free joints.

/// All other joints are locked: the diagonal of the mass matrix.
std::vector<double> locked_inertia(const Scene& scene);
/// All other joints are free: one over the diagonal of the inverse, MuJoCo's dof_invweight0. Not above 0 or NaN where
/// the matrix is singular.
std::vector<double> free_inertia(const Scene& scene);

/// By body, in the drawn pose with all joints free: how fast its center moves after a unit impulse there, in the mean
/// over directions, 1/kg. 0 of bodies that stand still, not finite where the matrix is singular. MuJoCo's
/// body_invweight0.
std::vector<double> body_responses(const Scene& scene);

}  // namespace lockstep::importer::mjcf
