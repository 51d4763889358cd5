// Places followers by their couplings, and tests whether they are consistent. SPDX-License-Identifier: Apache-2.0
//
// (M76). The position of a follower is that of the other joints through its coupling, plus what is left of an error. So
// a consistent follower stays consistent to the last bit. If all followers are, a step has nothing to correct.
#pragma once

#include "coupling_error.h"
#include "kernels/tile/tile_shape.h"

namespace lockstep::kernels {

/// The velocity that follower f has by S, for the solver's velocities z.
template <class T>
LOCKSTEP_INLINE T followed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f, const T* z) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  T sum = T(0);
  for (int s = r.start[f]; s < r.start[f + 1]; ++s) sum = add_product(x.couplings.share[s], z[r.column[s]], sum);
  return sum;
}

/// Errors that are only rounding become zero, because a correction would only flip the last digit. An error that is NaN
/// or beyond the position bound stays.
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

/// Next positions of the followers, from those of the other joints and what is left of their errors.
template <class T>
void place_followers(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  for (int i = 0; i < t.reduction.placing.count; ++i) {
    const int c = t.reduction.placing[i];
    const T left = fnma(T(t.dt * t.reduction.rate[c]), x.couplings.error[c], x.couplings.error[c]);
    x.next.q[t.term_joint[t.term_start[c]]] = left - others_of(t, x, c, x.next.q);
  }
}

/// Lanes that have an inconsistent follower among the placed ones. Positions and velocities are compared to the last
/// bit.
template <class T>
LOCKSTEP_INLINE typename T::Mask any_inconsistent(const Tables<ScalarOf<T>>& t, const Tile<T>& x,
                                                  const TileShape& shape) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const T *const q = x.state.q, *const v = x.state.v;
  const int* const velocity = shape.velocity;
  typename T::Mask inconsistent = T::none();
  for (int p = 0; p < shape.pair_count; ++p) {
    const Pair& pair = shape.pairs[p];
    const T other = fma(x.couplings.coefficient[pair.term], q[pair.leader], x.couplings.offset[pair.coupling]);
    inconsistent = inconsistent | beyond(q[pair.follower] + other, T(0)) |
                   beyond(v[velocity[pair.follower]] - x.couplings.share[pair.value] * v[velocity[pair.leader]], T(0));
  }
  if (shape.pair_count > 0) return inconsistent;
  for (int i = 0; i < r.placing.count; ++i)
    inconsistent = inconsistent | beyond(coupling_error(t, x, r.placing[i], x.state.q), T(0));
  for (int f = 0; f < r.followers; ++f) {
    if (!r.placed[f]) continue;
    T speed = T(0);  // in the order of followed()
    for (int s = r.start[f]; s < r.start[f + 1]; ++s)
      speed = fma(x.couplings.share[s], v[velocity[r.leader[s]]], speed);
    inconsistent = inconsistent | beyond(v[velocity[r.follower[f]]] - speed, T(0));
  }
  return inconsistent;
}

/// Whether all placed followers are consistent, in all lanes that are not frozen, and no lane has whole turns. So a
/// step of consistent followers has the plan's offsets.
template <class T>
LOCKSTEP_INLINE bool all_consistent(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const TileShape& shape) {
  return shape.consistent_is_shorter && !x.turned && !any(any_inconsistent(t, x, shape) & ~x.frozen);
}

}  // namespace lockstep::kernels
