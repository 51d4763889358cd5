// Routines: stretches of a step that the tables run as machine code, where a plan has some. SPDX-License-Identifier:
// Apache-2.0
//
// A step that cannot be machine code as a whole, because it solves contacts, still has long stretches without
// decisions. Each reads and changes numbers of the tile, and nothing else: neither counts nor pointers.
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Runs a routine by its code, or else `body`, which is the same.
template <class T, class Body>
LOCKSTEP_INLINE void routine(const Tables<ScalarOf<T>>& t, Tile<T>& x, Routine which, Body&& body) {
  if (const RoutineCode code = x.routines.code_of(&t, which))
    code(x.routines.frame, x.routines.behind);
  else
    body();
}

}  // namespace lockstep::kernels
