// The couplings' impulses of this step, for those who asked to keep them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compete.h"

namespace lockstep::kernels {

/// J^T of the bounded rows' impulses, subtracted from `sum` over all velocities. Where several joints' bounds are one
/// row, an end of the interval is pushed by the joint whose end it is, friction by each in proportion.
template <class T>
void subtract_bounds(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* sum) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const int root = t.velocities - t.joints;
  const Phase phase = t.solve_twice ? velocity_phase : position_phase;
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i], p = phase * b.form.count + r;
    const T impulse = select(x.bound_touched[r], x.bound_impulse[p], T(0));
    if (b.kind[r] == BoundKind::coupling) {
      const int c = b.form.coupling[r];
      for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
        sum[root + t.term_joint[k]] = fnma(x.coefficient[k], impulse, sum[root + t.term_joint[k]]);
      continue;
    }
    const auto slips = ~(less(x.bound_force[r], impulse) | less(impulse, -x.bound_force[r]));
    auto left = ~slips;
    for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m) {
      const Member member = b.member[m];
      const bool alone = b.member_start[r + 1] - b.member_start[r] == 1;
      T part = impulse;
      if (!alone) {
        const Moment<T> at{phase == velocity_phase && t.velocity_iterations > 0, S(1) / t.dt};
        const Interval<T> own = joint_interval(t, x, member.joint, at, T(0));
        const T one = own.lo * x.member_inverse[m], other = own.hi * x.member_inverse[m];
        const auto ends = ~less(smaller(one, other), x.bound_lo[p]) | ~less(x.bound_hi[p], larger(one, other));
        const auto pushes = left & (ends | (m + 1 == b.member_start[r + 1] ? ~T::none() : T::none()));
        left = left & ~pushes;
        const T friction = b.has[member.joint] & has_friction ? T(b.friction[member.joint]) : T(0);
        const T weight = larger(x.member_share[m], -x.member_share[m]) * friction / larger(x.bound_force[r], smallest<T>());
        part = select(pushes, impulse, select(slips, impulse * weight, T(0)));
      }
      sum[root + member.joint] = fnma(x.member_inverse[m], part, sum[root + member.joint]);
    }
  }
}

/// Swept and solved rows have theirs at hand. An eliminated coupling's (M44) is what its followers' momentum lacks:
/// J_F^T L = (A (v' - v) - dt forces - other rows' J^T L) on the followers. By force, x.drive holds A d as well.
template <class T>
void coupling_impulses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const int root = t.velocities - t.joints;
  const T* solved = t.solve_twice ? x.velocity_impulse : x.position_impulse;
  for (int c = 0; c < t.couplings; ++c) x.impulse[c] = T(0);
  for (int i = 0; i < rows.count; ++i) x.impulse[rows.coupling[i]] = solved[i];
  const int bounds = t.bounds.form.count;
  for (int i = 0; i < bounds; ++i)
    if (t.bounds.kind[i] == BoundKind::coupling)
      x.impulse[t.bounds.form.coupling[i]] =
          select(x.bound_touched[i], x.bound_impulse[(t.solve_twice ? bounds : 0) + i], T(0));
  if (!r.eliminates()) return;

  T* const change = x.corrected_product;
  for (int i = 0; i < t.velocities; ++i) {
    x.product[i] = -x.drive[i];
    change[i] = x.next_v[i] - x.v[i];
  }
  for (int f = 0; r.by_force && f < r.followers; ++f) change[root + r.follower[f]] += x.mismatch[f];
  if (bounds > 0) subtract_bounds(t, x, x.product);
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
      lacking = fma(x.matrix[columns.offset[i] + k], change[i + k], lacking);
    for (int j = columns.parent[i]; j >= 0; j = columns.parent[j])
      lacking = fma(x.matrix[columns.offset[j] + i - j], change[j], lacking);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
      T& sum = x.impulse[r.inverse_coupling[s]];
      sum = fma(x.inverse_form[s], lacking, sum);
    }
  }
}

}  // namespace lockstep::kernels
