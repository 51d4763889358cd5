// The integrators beyond first order, each in its plainest form. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "lockstep/step.h"
#include "mechanism.h"

namespace lockstep::reference {

/// Sets what acts at `share` of a step, 0 at its start and 1 at its end; called with the model's inputs.
using InputsInStep = std::function<void(double share, Inputs& inputs)>;

/// One step of settings.dt by settings.integrator: leapfrog, extrapolated or runge_kutta, others are refused
/// (SettingsError). Bounds are left out. A leapfrog has the wrenches and switches of the middle of its step. A mixing
/// softness is the spring that it is at steps of settings.dt, (M29), in the half steps of `extrapolated` too.
State integrated(const Mechanism& mechanism, const StepSettings& settings, const State& state, const InputsInStep& set);

}  // namespace lockstep::reference
