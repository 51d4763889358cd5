// Sets the fault of an environment, with what found it and the dof to blame. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// An environment that has a fault keeps it. Its steps are counted here, up to the one that failed.
template <class T>
void set_fault(const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x, int lane, Fault fault, FaultPlace place) {
  if (batch.fault[lane] != Fault::none) return;
  batch.fault[lane] = fault;
  batch.place[lane] = place;
  batch.steps[lane] += x.step;
}

/// The dof that is farthest beyond its bounds, the first of several. NaN is beyond any number. -1 if none is beyond.
template <class T>
int dof_beyond(const Tables<ScalarOf<T>>& t, const State<T>& state, int lane) {
  using S = ScalarOf<T>;
  constexpr S most = largest_number<S>;
  S worst = S(1);
  int dof = -1;
  const auto look = [&](int j, S number, S bound) {
    const S share = (number < S(0) ? -number : number) / bound;
    if (worst < most && !(share <= worst)) worst = share <= most ? share : most, dof = t.dof[j];
  };
  for (int j = 0; j < t.joints; ++j) {
    const bool turns = t.turns.count > 0 && t.turns[j];
    look(j, state.q[j].lane(lane), turns ? most : t.position_bound);
    look(j, state.v[t.velocity_of(j)].lane(lane), t.velocity_bound);
  }
  return dof;
}

template <class T>
int fastest_dof(const Tables<ScalarOf<T>>& t, const State<T>& state, int lane) {
  using S = ScalarOf<T>;
  S fastest = S(-1);
  int dof = -1;
  for (int j = 0; j < t.joints; ++j) {
    const S v = state.v[t.velocity_of(j)].lane(lane), speed = v < S(0) ? -v : v;
    if (speed > fastest) fastest = speed, dof = t.dof[j];
  }
  return dof;
}

}  // namespace lockstep::kernels
