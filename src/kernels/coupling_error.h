// C = J q + gamma of every coupling, (3) and (17) of the note. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Coefficient of a coupling's term: the table's, or this tile's own gear ratio.
template <class T>
LOCKSTEP_INLINE T coefficient(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int term) {
  const int gear = t.term_gear[term];
  if (lanes.field[0] && gear >= 0) return T::load(lanes.field[0] + gear * lanes.stride);
  return T(t.term_value[term]);
}

template <class T>
void coupling_errors(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, const T* q, T* error) {
  const Field<T> offset = field<T>(lanes, 1, t.offset.data);
  for (int c = 0; c < t.couplings; ++c) {
    T sum = offset.at(c, c);
    for (int k = t.term_start[c + 1] - 1; k >= t.term_start[c]; --k)
      sum = fma(coefficient<T>(t, lanes, k), q[t.term_joint[k]], sum);
    error[c] = sum;
  }
}

}  // namespace lockstep::kernels
