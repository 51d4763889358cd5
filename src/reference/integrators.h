// The integrators beyond first order, as plainly as possible. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "lockstep/step.h"
#include "mechanism.h"

namespace lockstep::reference {

/// Sets the inputs at a share of the step: 0 is its start, 1 its end. `inputs` are the model's when it is called.
using InputsInStep = std::function<void(double share, Inputs& inputs)>;

/// One step of settings.dt by settings.integrator. Throws SettingsError unless that is leapfrog, extrapolated or
/// runge_kutta. Bounds are left out. A leapfrog takes wrenches and switches at the middle of its step. An ErpCfm is the
/// spring of a step of settings.dt, (M29), also in the half steps of `extrapolated`. Only a leapfrog has closed loops,
/// hard ones without limits; `chords` are the steps that close them at its end.
State integrated(const Mechanism& mechanism, const StepSettings& settings, const State& state, const InputsInStep& set,
                 int chords = 1);

/// (M67): the bias forces of a leapfrog, at its middle and along its axes there.
Eigen::VectorXd predicted_bias(const Mechanism& mechanism, const StepSettings& settings, const State& start,
                               const Inputs& inputs);

}  // namespace lockstep::reference
