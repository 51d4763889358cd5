// The step of one plan as a graph: the kernels run once on numbers that write down. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/program.h"
#include "graph.h"

namespace lockstep::generate {

/// Throws SettingsError for the few plans that straight-line code cannot do.
Graph record_step(const Program& program);

}  // namespace lockstep::generate
