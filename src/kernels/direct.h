// All rows at once: (K + cfm) L = -(J v* + b) by L^T D L. SPDX-License-Identifier: Apache-2.0
//
// (M34). Exact for chains and stars of couplings, where sweeps converge slowly or not at all.
#pragma once

#include "row_terms.h"

namespace lockstep::kernels {

/// Pivots below this share of their row's own response are rounding: such a row repeats others and takes no impulse.
template <class S>
struct RankTolerance;
template <>
struct RankTolerance<float> {
  static constexpr float value = 4e-6f;
};
template <>
struct RankTolerance<double> {
  static constexpr double value = 1e-12;
};

template <class T>
LOCKSTEP_INLINE void solve_rows(const Rows<ScalarOf<T>>& rows, const Tile<T>& x, T* impulse) {
  solve_upwards(rows.columns, x.coupled, impulse);
  for (int r = 0; r < rows.count; ++r) impulse[r] *= x.row_inverse[r];
  solve_downwards(rows.columns, x.coupled, impulse);
}

template <class T>
void direct(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  for (int r = 0; r < rows.count; ++r) {
    x.coupled[rows.columns.offset[r]] += x.row_cfm[r];
    x.position_impulse[r] = -(x.row_speed[r] + x.row_bias[r]);
    x.velocity_impulse[r] = -(x.row_speed_closed[r] + closing_bias(x, r));
  }
  factor(rows.columns, x.coupled, x.row_inverse, T(RankTolerance<ScalarOf<T>>::value), x.scratch);
  solve_rows(rows, x, x.position_impulse);
  if (t.solve_twice) solve_rows(rows, x, x.velocity_impulse);
}

}  // namespace lockstep::kernels
