// The plans that kernels are generated for. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/lockstep.h"

namespace lockstep::generated {

/// The plan of a name: SCENE_METHOD, random_SEED, for long trees deep_SEED, or for several trees forest_SEED. Suffixes:
/// - `_fields`: all parameters differ per environment; Euler's method records impulses
/// - `_bounds`: every kind of bound; the plan records diagnostics
/// - `_tendons`: tendons; for seeds of the method reduced alone
/// - `_limits`: random bounds without effort limits
/// - `_leapfrog`, `_extrapolated`, `_runge_kutta`: the integrator
/// - `_inputs`: inputs per stage
Plan plan_of(const std::string& name);

}  // namespace lockstep::generated
