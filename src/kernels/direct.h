// All rows at once: (K + cfm) L = -(J v* + b) by L^T D L. SPDX-License-Identifier: Apache-2.0
//
// (M38). Exact for chains and stars of couplings, where sweeps converge slowly or not at all.
#pragma once

#include "row_terms.h"

namespace lockstep::kernels {

/// A pivot below this share of its row's own response is rounding: the row repeats others and takes no impulse.
/// Rows that repeat others in every environment are gone since compiling, so only scenes whose gear ratios or
/// softness differ, or that are switched, have to look closely; the others would lose steep gears to it.
template <class T>
LOCKSTEP_INLINE T rank_tolerance(const Tables<ScalarOf<T>>& t) {
  const bool rank_may_differ = declared<T>(t, 0) || declared<T>(t, 2) || declared<T>(t, 8);
  return T(ScalarOf<T>(rank_may_differ ? 32 : 1)) * T::rounding();
}

template <class T>
LOCKSTEP_INLINE void solve_rows(const Rows<ScalarOf<T>>& rows, const Tile<T>& x, T* impulse) {
  solve_upwards(rows.columns, x.coupled, impulse);
  for (int r = 0; r < rows.count; ++r) impulse[r] *= x.row_inverse[r];
  solve_downwards(rows.columns, x.coupled, impulse);
}

/// K + cfm to its factors.
template <class T>
void factor_rows(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  for (int r = 0; r < rows.count; ++r) x.coupled[rows.columns.offset[r]] += x.row_cfm[r];
  factor(rows.columns, x.coupled, x.row_inverse, rank_tolerance<T>(t));
}

template <class T>
void direct(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  for (int r = 0; r < rows.count; ++r) {
    x.position_impulse[r] = -(x.row_speed[r] + x.row_bias[r]);
    x.velocity_impulse[r] = -(x.row_speed_closed[r] + closing_bias(x, r));
  }
  solve_rows(rows, x, x.position_impulse);
  if (x.solves_twice) solve_rows(rows, x, x.velocity_impulse);
  for (int r = 0; rows.known.count > 0 && r < rows.count; ++r) {
    x.row_speed[r] = -x.row_bias[r];
    x.row_speed_closed[r] = -closing_bias(x, r);
  }
}

}  // namespace lockstep::kernels
