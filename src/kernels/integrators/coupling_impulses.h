// The impulses of the couplings in this step, for plans that record them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/contacts/impulses.h"
#include "kernels/couplings/folding.h"
#include "kernels/loops/impulses.h"
#include "solve_bounds.h"

namespace lockstep::kernels {

/// Subtracts J^T of the bounded rows' impulses from `sum`, over all velocities. Several joints may share a row. Then
/// the joint whose end of the interval is reached takes the impulse, and friction is divided in proportion.
template <class T>
void subtract_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x, T* sum) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const Phase phase = t.solve_twice ? velocity_phase : position_phase;
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i], p = phase * b.rows.count + r;
    const T impulse = select(x.bounds.active[r], x.bounds.impulse[p], T(0));

    // A coupling's row pushes all of its joints.
    if (b.kind[r] == BoundKind::coupling) {
      const int c = b.rows.coupling[r];
      for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k)
        sum[t.velocity_of(t.term_joint[k])] =
            fnma(x.couplings.coefficient[k], impulse, sum[t.velocity_of(t.term_joint[k])]);
      continue;
    }

    // A joint's row: within the box all is friction, beyond it one joint is at its end.
    const auto in_box = ~(less(x.bounds.force[r], impulse) | less(impulse, -x.bounds.force[r]));
    auto remaining = ~in_box;
    for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m) {
      const Member member = b.member[m];
      const bool single = b.member_start[r + 1] - b.member_start[r] == 1;
      T part = impulse;
      if (!single) {
        const StepTime<T> at{phase == velocity_phase && t.velocity_iterations > 0, S(1) / t.dt};
        const Interval<T> own = joint_interval(t, batch, x, member.joint, at, T(0));
        const T one = own.lo * x.bounds.member_inverse[m], other = own.hi * x.bounds.member_inverse[m];
        const auto ends = ~less(smaller(one, other), x.bounds.lo[p]) | ~less(x.bounds.hi[p], larger(one, other));
        const auto takes_all = remaining & (ends | (m + 1 == b.member_start[r + 1] ? ~T::none() : T::none()));
        remaining = remaining & ~takes_all;
        const T friction = b.has[member.joint] & has_friction ? friction_impulse<T>(t, batch, member.joint) : T(0);
        const T weight = larger(x.bounds.member_share[m], -x.bounds.member_share[m]) * friction /
                         larger(x.bounds.force[r], smallest<T>());
        part = select(takes_all, impulse, select(in_box, impulse * weight, T(0)));
      }
      sum[t.velocity_of(member.joint)] = fnma(x.bounds.member_inverse[m], part, sum[t.velocity_of(member.joint)]);
    }
  }
}

/// Rows that were swept or solved have their impulses. That of an eliminated coupling (M44) is what the momentum of its
/// followers lacks: J_F^T L = (A (v' - v) - dt forces - J^T L of other rows) on the followers. Where bias forces remove
/// velocity errors, x.dynamics.rhs holds A times these errors as well.
template <class T>
void coupling_impulses(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const T* solved = t.solve_twice ? x.rows.velocity_impulse : x.rows.position_impulse;

  // Impulses that were solved: of rows, of folded couplings, of couplings with a force limit.
  folded_impulses(t, x);
  for (int c = 0; c < t.couplings; ++c) x.couplings.impulse[c] = T(0);
  for (int i = 0; i < t.impulse_coupling.count; ++i) x.couplings.impulse[t.impulse_coupling[i]] = solved[i];
  const int bounds = t.bounds.rows.count;
  for (int i = 0; i < bounds; ++i)
    if (t.bounds.kind[i] == BoundKind::coupling)
      x.couplings.impulse[t.bounds.rows.coupling[i]] =
          select(x.bounds.active[i], x.bounds.impulse[(t.solve_twice ? bounds : 0) + i], T(0));
  if (!r.eliminates()) return;

  // (M44): v' - v, and minus the impulses that are known.
  T* const change = x.dynamics.corrected_product;
  for (int i = 0; i < t.velocities; ++i) {
    x.dynamics.product[i] = -x.dynamics.rhs[i];
    change[i] = x.next.v[i] - x.state.v[i];
  }
  for (int i = 0; i < t.rounds.servos.count; ++i) {  // neither A nor the forces hold these servos
    const int j = t.limited_servos[i];
    const T effort = feed_forward<T>(t, batch, j), sigma = x.servos.saturation[i], v = x.next.v[t.velocity_of(j)];
    const T force = select(beyond(sigma, T(0)), sigma * effort_limit<T>(t, batch, j),
                           servo<T>(t, batch, x, j).force(T(t.dt), x.state.q[j], v) + effort);
    x.dynamics.product[t.velocity_of(j)] = fnma(T(t.dt), force - effort, x.dynamics.product[t.velocity_of(j)]);
  }
  for (int f = 0; r.removes_by_force && f < r.followers; ++f)
    change[t.velocity_of(r.follower[f])] += x.couplings.velocity_error[f];
  if (bounds > 0) subtract_bounds(t, batch, x, x.dynamics.product);
  if (t.contacts.used()) subtract_contacts(t, x, x.dynamics.product);
  if (t.loops.used()) subtract_loops(t, x, x.dynamics.product);
  for (int i = 0; i < t.impulse_coupling.count; ++i) {
    const int c = t.impulse_coupling[i];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      T& sum = x.dynamics.product[t.velocity_of(t.term_joint[k])];
      sum = fnma(x.couplings.coefficient[k], solved[i], sum);
    }
  }

  // What each follower lacks, and the couplings that supply it.
  const Columns& columns = t.matrix;
  for (int f = 0; f < r.followers; ++f) {
    const int i = t.velocity_of(r.follower[f]);
    T lacking = x.dynamics.product[i];
    for (int k = 0; k < columns.size[i]; ++k)
      lacking = fma(x.dynamics.matrix[columns.offset[i] + k], change[i + k], lacking);
    for (int j = columns.parent[i]; j >= 0; j = columns.parent[j])
      lacking = fma(x.dynamics.matrix[columns.offset[j] + i - j], change[j], lacking);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
      T& sum = x.couplings.impulse[r.inverse_coupling[s]];
      sum = fma(x.couplings.follower_inverse[s], lacking, sum);
    }
  }
}

}  // namespace lockstep::kernels
