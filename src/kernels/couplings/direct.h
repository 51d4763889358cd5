// All rows at once: (K + cfm) L = -(J v* + b) by L^T D L. SPDX-License-Identifier: Apache-2.0
//
// (M38). Exact for chains and stars of couplings, where sweeps converge slowly or not at all.
#pragma once

#include "row_terms.h"

namespace lockstep::kernels {

/// A pivot below this share of its row's own response is rounding: the row repeats others and takes no impulse.
/// compile() has removed hard rows that repeat others in every environment. So the tolerance is larger only where gear
/// ratios, softness or switches differ between environments. Elsewhere a large one would take the rows of steep gears
/// for rounding.
template <class T>
LOCKSTEP_INLINE T rank_tolerance(const Tables<ScalarOf<T>>& t) {
  const bool rank_may_differ =
      t.declares(Parameter::gear_ratio) || t.declares(Parameter::softness) || t.declares(Parameter::coupling_switch);
  return T(ScalarOf<T>(rank_may_differ ? 32 : 1)) * T::rounding();
}

template <class T>
LOCKSTEP_INLINE void solve_rows(const Rows<ScalarOf<T>>& rows, const Tile<T>& x, T* impulse) {
  solve_upwards(rows.columns, all_of(rows.columns), x.rows.delassus, impulse);
  for (int r = 0; r < rows.count; ++r) impulse[r] *= x.rows.inverse[r];
  solve_downwards(rows.columns, all_of(rows.columns), x.rows.delassus, impulse);
}

/// Factors K + cfm.
template <class T>
void factor_rows(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  for (int r = 0; r < rows.count; ++r) x.rows.delassus[rows.columns.offset[r]] += x.rows.cfm[r];
  factor(rows.columns, all_of(rows.columns), x.rows.delassus, x.rows.inverse, rank_tolerance<T>(t));
}

template <class T>
void direct(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  for (int r = 0; r < rows.count; ++r) {
    x.rows.position_impulse[r] = -(x.rows.speed[r] + x.rows.bias[r]);
    x.rows.velocity_impulse[r] = -(x.rows.velocity_phase_speed[r] + velocity_phase_bias(t, x, r));
  }
  solve_rows(rows, x, x.rows.position_impulse);
  if (x.solves_twice) solve_rows(rows, x, x.rows.velocity_impulse);
  for (int r = 0; rows.known.count > 0 && r < rows.count; ++r) {
    x.rows.speed[r] = -x.rows.bias[r];
    x.rows.velocity_phase_speed[r] = -velocity_phase_bias(t, x, r);
  }
}

}  // namespace lockstep::kernels
