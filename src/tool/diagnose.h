// What bounds and energy do over a run. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "targets.h"

namespace lockstep::tool {

/// More environments than this tell nothing new for the time that it takes to look at them.
inline constexpr int most_diagnosed = 64;
inline constexpr int most_conflicts_listed = 16;

/// The first step after which an environment had rows that could not be met: Batch::conflicts().
struct Conflict {
  int environment;
  double time;  ///< s, at the end of that step
  std::vector<std::string> rows;
};

/// Extremes over all steps and environments; one that faults counts until it does. The start does not count.
struct Diagnosis {
  int environments = 0;
  double energy_excess_max = 0.0;    ///< J, beyond what drives, efforts and corrections put in since the start, (M65)
  double limit_violation_max = 0.0;  ///< rad or m
  double speed_max = 0.0;            ///< rad/s or m/s
  int conflict_count = 0;            ///< environments that had one
  std::vector<Conflict> conflicts;   ///< theirs in the order of time, the first most_conflicts_listed
};

/// Takes a batch from its start over so many steps and looks at it after each one. Where its plan
/// records no diagnostics, the energy's excess is no number: steps of integrators other than Euler keep no balance.
template <class S>
Diagnosis diagnose(Batch<S>& batch, const Targets& targets, long steps);

}  // namespace lockstep::tool
