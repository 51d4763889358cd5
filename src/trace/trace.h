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

/// Throws SettingsError for the few plans that straight-line code cannot run.
TracedStep trace_step(const Program& program);

}  // namespace lockstep::trace
