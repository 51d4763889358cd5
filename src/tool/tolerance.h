// Finds the cheapest step that is exact enough for a motion. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "chart_runs.h"
#include "targets.h"

namespace lockstep::tool {

struct Chosen {
  ChartSetting setting;
  double error;    ///< rms over all joints, rad or m
  double seconds;  ///< of the motion that was tried
};

/// Tries integrators and step sizes on the first `seconds` of the motion of one environment, at most probe_seconds,
/// with these targets. Takes the one with the fewest flops whose error is at most `tolerance`. Method and ignored
/// bounds are those of `settings`; so is the integrator unless it is automatic. Throws InputError where no step is
/// exact enough, or where the motion is not known so closely.
Chosen choose_step(const Model& model, const StepSettings& settings, bool f64, double tolerance, double seconds,
                   const Targets& targets);

inline constexpr double probe_seconds = 2.0;

}  // namespace lockstep::tool
