// Followers where the others put them, and how far they are from there. SPDX-License-Identifier: Apache-2.0
//
// (M76). Positions of followers are those of the others through their couplings, and what is left of an error beside:
// so a follower that is in place stays there to the last bit, and a step in which all of them are has nothing to
// correct.
#pragma once

#include "coupling_error.h"
#include "kernels/tile/tile_shape.h"

namespace lockstep::kernels {

/// Sum of S's row of follower f over the solver's velocities z.
template <class T>
LOCKSTEP_INLINE T followed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f, const T* z) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  T sum = T(0);
  for (int s = r.start[f]; s < r.start[f + 1]; ++s) sum = add_product(x.couplings.share[s], z[r.column[s]], sum);
  return sum;
}

/// Errors that rounding keeps a correction from moving are none. One of a follower that is nowhere is not of these.
template <class T>
void drop_rounding(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int i = 0; i < t.reduction.placing.count; ++i) {
    const int c = t.reduction.placing[i];
    const T error = x.couplings.error[c],
            near = x.state.q[t.term_joint[t.term_start[c]]] * (T(ScalarOf<T>(4)) * T::rounding());
    const auto stays = (beyond(error, near) & beyond(error, -near)) | beyond(error, T(t.position_bound));
    x.couplings.error[c] = x.consistent ? T(0) : select(stays, error, T(0));
  }
}

/// Followers' next positions, from the others' and what is left of their couplings' errors.
template <class T>
void place_followers(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  for (int i = 0; i < t.reduction.placing.count; ++i) {
    const int c = t.reduction.placing[i];
    const T left = fnma(T(t.dt * t.reduction.rate[c]), x.couplings.error[c], x.couplings.error[c]);
    x.next.q[t.term_joint[t.term_start[c]]] = left - others_of(t, x, c, x.next.q);
  }
}

/// StatePointers in which one of them is not in place: positions and velocities to the last bit.
template <class T>
LOCKSTEP_INLINE typename T::Mask any_inconsistent(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const TileShape& o) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const T *const q = x.state.q, *const v = o.floating ? x.state.v + 6 : x.state.v;
  typename T::Mask off = T::none();
  for (int p = 0; p < o.pair_count; ++p) {
    const Pair& pair = o.pairs[p];
    const T other = fma(x.couplings.coefficient[pair.term], q[pair.leader], x.couplings.offset[pair.coupling]);
    off = off | beyond(q[pair.follower] + other, T(0)) |
          beyond(v[pair.follower] - x.couplings.share[pair.value] * v[pair.leader], T(0));
  }
  if (o.pair_count > 0) return off;
  for (int i = 0; i < r.placing.count; ++i) off = off | beyond(coupling_error(t, x, r.placing[i]), T(0));
  for (int f = 0; f < r.followers; ++f) {
    T speed = T(0);  // as followed() has it
    for (int s = r.start[f]; s < r.start[f + 1]; ++s) speed = fma(x.couplings.share[s], v[r.leader[s]], speed);
    off = off | beyond(v[r.follower[f]] - speed, T(0));
  }
  return off;
}

/// All of them in place, in all lanes that move.
template <class T>
LOCKSTEP_INLINE bool all_consistent(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const TileShape& o) {
  return o.consistent_is_shorter && !any(any_inconsistent(t, x, o) & ~x.frozen);
}

}  // namespace lockstep::kernels
