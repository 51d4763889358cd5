// What couplings that are left to solve make of the free velocity, by the plan's method. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "direct.h"
#include "pgs.h"
#include "tgs.h"

namespace lockstep::kernels {

/// The impulses of the couplings' rows, and the speeds that these come to.
template <class T>
void solve_couplings(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  responses(t, x);
  row_softness(t, lanes, x);
  row_terms(t, x);
  switch (t.method) {
    case method_pgs: pgs(t, x); break;
    case method_tgs: tgs(t, x); break;
    default:  // direct, and what reduced leaves to solve
      factor_rows(t, x);
      direct(t, x);
  }
}

/// The speeds alone, as direct() leaves them where all rows are hard and have a velocity of the solver each (M79).
template <class T>
void prescribe_speeds(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int r = 0; r < t.rows.count; ++r) {
    x.row_speed[r] = -(T(t.rows.softness[r].rate) * x.coupling_error[t.rows.coupling[r]]);
    x.row_speed_closed[r] = -T(0);
  }
}

}  // namespace lockstep::kernels
