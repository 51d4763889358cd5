// The step of one plan as a graph: the kernels run once on traced numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "ir.h"
#include "kernels/tile/routine_code.h"
#include "plan/program.h"

namespace lockstep::trace {

struct TracedStep {
  Graph any;                        ///< for any tile
  std::optional<Graph> consistent;  ///< for a tile of consistent followers, if that is shorter (section 14)
};

/// With `scopes`, stages that decide by values are traced where they can be; else they are calls. Throws SettingsError
/// for the plans that cannot be traced.
TracedStep trace_step(const Program& program, bool scopes);

/// The routines of a step (kernels/tile/routine_code.h).
struct TracedRoutines {
  std::array<std::optional<Graph>, kernels::routine_count> graph;  ///< by number
  std::vector<Place> unread;                                       ///< inputs on which none of them depends
};

/// Whether the tables take the steps of a plan, with routines: contacts, loops, and what stages of leapfrog cannot hold
/// are solved by values.
bool takes_routines(const Tables<double>& t);

/// Of such a plan. None stands where a routine decides by values, or is not run. Those of leapfrog are of its midpoint.
TracedRoutines trace_routines(const Program& program);

/// Whether the solve with bounds is traced as scopes.
bool traces_bounds(const Tables<double>& t);

/// Scopes of more do not fit into the first cache: the tables are faster. Stages of leapfrog with bounds are longer.
constexpr int most_velocities_of_scopes = 30, most_velocities_of_stages = 16;

}  // namespace lockstep::trace
