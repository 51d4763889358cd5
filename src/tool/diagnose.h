// What bounds and energy do over a run. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "targets.h"

namespace lockstep::tool {

/// Environments that are diagnosed at most. More take time and tell nothing new.
inline constexpr int most_diagnosed = 64;
inline constexpr int most_conflicts_listed = 16;

/// The first step in which rows of an environment could not be met: Batch::conflicts().
struct Conflict {
  int environment;  ///< its id
  double time;      ///< s, at the end of that step
  std::vector<std::string> rows;
};

/// Extremes over all steps and environments. An environment counts until it faults. The start does not count.
struct Diagnosis {
  int environments = 0;
  double energy_excess_max = 0.0;    ///< J, beyond what drives, efforts and corrections put in since the start, (M65);
                                     ///< NaN if the plan records no diagnostics
  double limit_violation_max = 0.0;  ///< rad or m
  double speed_max = 0.0;            ///< rad/s or m/s
  double penetration_max = 0.0;      ///< m, of colliders
  double slip_max = 0.0;             ///< m/s, of contacts that bear a force
  double contacts_mean = 0.0;        ///< pairs of colliders that press on each other, in an environment and step
  double near_mean = 0.0;            ///< the same: pairs that are near
  double points_mean = 0.0;          ///< the same: points that could act
  double rounds_mean = 0.0;          ///< the same: rounds of the environment's solves
  double tile_rounds_mean = 0.0;     ///< the same: of all solves of its tile
  long unfinished_contacts = 0;      ///< solves that ended at their cap of rounds
  int conflict_count = 0;            ///< environments that had one
  std::vector<Conflict> conflicts;   ///< in the order of time, at most most_conflicts_listed
};

/// Steps the batch `steps` times and diagnoses it after each step.
template <class S>
Diagnosis diagnose(Batch<S>& batch, const Targets& targets, long steps);

}  // namespace lockstep::tool
