// Control as data: what depends on the values in the lanes. SPDX-License-Identifier: Apache-2.0
//
// Wide numbers run these as they are. Traced numbers have no values, so a trace records these as scopes
// (trace/called_stages.h). A body changes numbers of the tile, and the mask that it is given by reference; it leaves
// nothing else to later code. An `if (any(mask))` beside these only saves work: traced code always does it.
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Runs `body` if a lane of the mask is true.
template <class T, class Body>
LOCKSTEP_INLINE void when(Tile<T>&, typename T::Mask mask, Body&& body) {
  if (any(mask)) body();
}

/// Runs `yes` if a lane of the mask is true, else `no`.
template <class T, class Yes, class No>
LOCKSTEP_INLINE void either_way(Tile<T>&, typename T::Mask mask, Yes&& yes, No&& no) {
  any(mask) ? yes() : no();
}

/// Repeats `body`, which may change the mask, while a lane of it is true, at most so often.
template <class T, class Body>
LOCKSTEP_INLINE void repeat_while(Tile<T>&, typename T::Mask& mask, int most, Body&& body) {
  for (int i = 0; i < most && any(mask); ++i) body();
}

/// Runs `body`, of which traced code has one copy for all places that run it by this name with these tables. The body
/// does the same at all of them: what differs is in numbers and masks of the tile.
template <class T, class Body>
LOCKSTEP_INLINE void subroutine(const Tables<ScalarOf<T>>&, Tile<T>&, const char*, Body&& body) {
  body();
}

}  // namespace lockstep::kernels
