// C = J q + gamma of every coupling: (M2), (3) and (17) of the note. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// a b + sum. A follower is consistent if this sum, to the last bit, is the one that placed it. So the order of such a
/// sum must not change: a traced step leaves it as it stands (trace/traced.h).
template <class T>
LOCKSTEP_INLINE T add_product(T a, T b, T sum) {
  return fma(a, b, sum);
}

/// C of the linear coupling c without its first joint.
template <class T>
LOCKSTEP_INLINE T others_of(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int c, const T* q) {
  T sum = x.couplings.offset[c];
  for (int k = t.term_start[c + 1] - 1, first = t.term_start[c]; k > first; --k)
    sum = add_product(x.couplings.coefficient[k], q[t.term_joint[k]], sum);
  return sum;
}

template <class T>
LOCKSTEP_INLINE T coupling_error(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int c, const T* q) {
  const int first = t.term_start[c];
  return fma(x.couplings.coefficient[first], q[t.term_joint[first]], others_of(t, x, c, q));
}

template <class T>
void coupling_errors(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int c = 0; c < t.couplings; ++c) x.couplings.error[c] = coupling_error(t, x, c, x.state.q);
  if (!t.functions.used()) return;
  for (int i = 0; i < t.functions.placing.count; ++i) x.couplings.error[t.functions.placing[i]] = T(0);  // (M138)
}

}  // namespace lockstep::kernels
