// The couplings' impulses of this step, for those who asked to keep them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "elimination.h"

namespace lockstep::kernels {

/// Swept and solved rows have theirs at hand. An eliminated coupling's (M39) is what its followers' momentum lacks:
/// J_F^T L = (A (v' - v) - dt forces - other rows' J^T L) on the followers.
template <class T>
void coupling_impulses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const int root = t.velocities - t.joints;
  const T* solved = t.solve_twice ? x.velocity_impulse : x.position_impulse;
  for (int c = 0; c < t.couplings; ++c) x.impulse[c] = T(0);
  for (int i = 0; i < rows.count; ++i) x.impulse[rows.coupling[i]] = solved[i];
  if (r.followers == 0) return;

  for (int i = 0; i < t.velocities; ++i) x.product[i] = -x.drive[i];
  for (int i = 0; i < rows.count; ++i) {
    const int c = rows.coupling[i];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      T& sum = x.product[root + t.term_joint[k]];
      sum = fnma(x.coefficient[k], solved[i], sum);
    }
  }
  const Columns& columns = t.matrix;
  for (int f = 0; f < r.followers; ++f) {
    const int i = root + r.follower[f];
    T lacking = x.product[i];
    for (int k = 0; k < columns.size[i]; ++k)
      lacking = fma(x.matrix[columns.offset[i] + k], x.next_v[i + k] - x.v[i + k], lacking);
    for (int j = columns.parent[i]; j >= 0; j = columns.parent[j])
      lacking = fma(x.matrix[columns.offset[j] + i - j], x.next_v[j] - x.v[j], lacking);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
      T& sum = x.impulse[r.inverse_coupling[s]];
      sum = fma(x.inverse_form[s], lacking, sum);
    }
  }
}

}  // namespace lockstep::kernels
