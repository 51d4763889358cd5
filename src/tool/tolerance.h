// The cheapest step that is exact enough for a motion, found by trying. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "chart_runs.h"
#include "targets.h"

namespace lockstep::tool {

struct Chosen {
  ChartSetting setting;
  double error;    ///< rms over all joints of the probe, rad or m
  double seconds;  ///< of the probe
};

/// Tries integrators and steps on the first of the `seconds` (probe_seconds at most) of the model's motion in one
/// environment with these targets, and takes the one that costs least, by flops, of those whose joints are off by no
/// more than `tolerance`. `settings` says the method, the bounds left out, and the integrator if it is to be one only.
/// Throws InputError where none is good enough or the motion cannot be told so closely.
Chosen choose_step(const Model& model, const StepSettings& settings, bool f64, double tolerance, double seconds,
                   const Targets& targets);

inline constexpr double probe_seconds = 2.0;

}  // namespace lockstep::tool
