// The step of one plan as a graph: the kernels run once on numbers that write down. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../plan/program.h"
#include "graph.h"

namespace lockstep::generate {

/// The step of any tile, or of one whose followers are all in place, where that is shorter (M76). Throws SettingsError
/// for the few plans that straight-line code cannot do.
Graph record_step(const Program& program, bool in_place = false);

}  // namespace lockstep::generate
