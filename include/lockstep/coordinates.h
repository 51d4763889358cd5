// Which dofs say where all others are. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/plan.h"

namespace lockstep {

/// Dofs that are coordinates of a state, in ascending order: no coupling that is hard places them, and no loop.
/// Followers of soft couplings are among them. Thread-safe. Throws UsageError where loops hold floating roots.
LOCKSTEP_API std::vector<int> coordinate_dofs(const Plan& plan);

/// The same with all loops open: joints that loops place are among them, too. Thread-safe.
LOCKSTEP_API std::vector<int> open_coordinate_dofs(const Plan& plan);

}  // namespace lockstep
