// The numbers and masks of a tile outside its arrays that traced code knows. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// visit(name, number or mask, lifetime), always in the same order.
template <class T, class Visit>
void each_own(Tile<T>& x, Visit&& visit) {
  visit("frozen", x.frozen, Lifetime::state);
  visit("singular", x.singular, Lifetime::step);
  visit("too_fast", x.too_fast, Lifetime::step);
  visit("bounds.candidate", x.bounds.candidate, Lifetime::stage);
  visit("bounds.invalid", x.bounds.invalid, Lifetime::stage);
  visit("servos.decided", x.servos.decided, Lifetime::stage);
  visit("servos.duration", x.servos.duration, Lifetime::stage);
  visit("search.open", x.search.open, Lifetime::stage);
  visit("search.going_on", x.search.going_on, Lifetime::stage);
  visit("stage_bounds.opened", x.stage_bounds.opened, Lifetime::stage);
  visit("stage_bounds.factored", x.stage_bounds.factored, Lifetime::stage);
  visit("stage_bounds.searched", x.stage_bounds.searched, Lifetime::stage);
  visit("guard.coarse", x.guard.coarse, Lifetime::stage);
  visit("guard.halved", x.guard.halved, Lifetime::stage);
  visit("guard.eta", x.guard.eta, Lifetime::stage);
  visit("guard.size", x.guard.size, Lifetime::stage);
  visit("rounds.open", x.rounds.open, Lifetime::stage);
  visit("rounds.weak", x.rounds.weak, Lifetime::stage);
  visit("rounds.largest", x.rounds.largest, Lifetime::stage);
  visit("rounds.fastest", x.rounds.fastest, Lifetime::stage);
  visit("rounds.slope", x.rounds.slope, Lifetime::stage);
}

}  // namespace lockstep::kernels
