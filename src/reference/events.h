// The continuous motion with bounds, event by event. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "truth.h"

namespace lockstep::reference {

/// As integrate(), for models with hard ranges, restitution, velocity limits, effort limits and dry friction. Between
/// events the motion is smooth, and Runge-Kutta 4 follows it. An event is found by bisection: a joint comes to an end
/// of its range or to its velocity limit, or stops slipping. Joints at rest at such a place have the accelerations that
/// satisfy all of their conditions at once, and impacts have such velocities: minima of convex.h. Kinematic drives,
/// soft limits and force limits are left out.
Motion integrate_with_events(const Mechanism& mechanism, const State& start, const InputsOverTime& inputs,
                             double interval, int intervals, int steps);

}  // namespace lockstep::reference
