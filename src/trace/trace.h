// The step of one plan as a graph: the kernels run once on numbers that write down. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "ir.h"
#include "plan/program.h"

namespace lockstep::trace {

struct TracedStep {
  Graph any;                        ///< of any tile
  std::optional<Graph> consistent;  ///< of one whose followers are all in place, where that is shorter (M76)
};

/// Throws SettingsError for the few plans that straight-line code cannot do.
TracedStep trace_step(const Program& program);

}  // namespace lockstep::trace
