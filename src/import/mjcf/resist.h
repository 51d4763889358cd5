// Tendons and springdampers: what resists the joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "import/draft.h"
#include "scene.h"
#include "ties.h"

namespace lockstep::importer::mjcf {

/// Gives the model the springs, damping, friction, armature and limits of tendons. A tendon whose joints are tied to
/// one gives them to that joint; the spring of any other becomes a soft coupling. What else a Model lacks is a warning.
void resist_tendons(const Scene& scene, const Ties& ties, Draft& draft);

/// Springs and damping that the file states by time constants. Throws ImportError where the joint moves no inertia.
void resist_by_time_constants(const Scene& scene, Draft& draft);

}  // namespace lockstep::importer::mjcf
