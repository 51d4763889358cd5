// C = J q + gamma of every coupling, (M2), (3) and (17) of the note. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

template <class T>
void coupling_errors(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const Field<T> offset = field<T>(lanes, 1, t.offset.data);
  for (int c = 0; c < t.couplings; ++c) {
    T sum = offset.at(c, c);
    for (int k = t.term_start[c + 1] - 1; k >= t.term_start[c]; --k)
      sum = fma(x.coefficient[k], x.q[t.term_joint[k]], sum);
    x.coupling_error[c] = sum;
  }
}

}  // namespace lockstep::kernels
