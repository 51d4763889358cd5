// Tendons and springdampers: what resists the joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "transmissions.h"

namespace lockstep::importer::mjcf {

/// Gives the model the springs, damping, friction, armature and limits of tendons: to their transmissions, or as soft
/// couplings where they have none. Spatial tendons are warnings.
void resist_tendons(const Scene& scene, const Ties& ties, const std::vector<std::optional<Transmission>>& transmissions,
                    Draft& draft);

/// Springs and damping that the file states by time constants. Throws ImportError where the joint moves no inertia.
void resist_by_time_constants(const Scene& scene, Draft& draft);

}  // namespace lockstep::importer::mjcf
