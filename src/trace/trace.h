// The step of one plan as a graph: the kernels run once on traced numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "ir.h"
#include "plan/program.h"

namespace lockstep::trace {

struct TracedStep {
  Graph any;                        ///< for any tile
  std::optional<Graph> consistent;  ///< for a tile of consistent followers, if that is shorter (section 14)
};

/// With `scopes`, stages that decide by values are traced where they can be; else they are calls. Throws SettingsError
/// for the plans that cannot be traced.
TracedStep trace_step(const Program& program, bool scopes);

/// Whether the solve with bounds is traced as scopes.
bool traces_bounds(const Tables<double>& t);

/// Scopes of more do not fit into the first cache: the tables are faster. Stages of leapfrog with bounds are longer.
constexpr int most_velocities_of_scopes = 30, most_velocities_of_stages = 16;

}  // namespace lockstep::trace
