// A leapfrog closes its loops in the positions that it reaches. SPDX-License-Identifier: Apache-2.0
//
// (M133), one step of the chord method: with J of the midpoint and its matrix, the least motion, as the masses measure
// it, that takes the gaps back. Couplings and velocities that a bound holds stay as they are.
#pragma once

#include "guard.h"
#include "integrate.h"
#include "kernels/couplings/functions.h"
#include "kernels/loops/find_loops.h"
#include "kernels/loops/impulses.h"
#include "kernels/rounds/rows.h"

namespace lockstep::kernels {

/// (M70): the velocities with which roots and balls go on from the midpoint, into x.state.v.
template <class T>
LOCKSTEP_INLINE void second_half_velocities(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto set = [&](int first, int count) LOCKSTEP_INLINED {
    for (int k = first; k < first + count; ++k)
      x.state.v[k] = fma(T(ScalarOf<T>(2)), x.stages.mean_velocity[k], -x.stages.midpoint.v[k]);
  };
  for (int r = 0; r < t.roots.count; ++r) set(t.roots[r].velocity, 6);
  for (int i = 0; i < t.balls.count; ++i) set(t.balls[i].velocity, 3);
}

/// Lanes in which row i of a loop is at its limit, or open as it is after that: nothing but its force closes it.
template <class T>
typename T::Mask has_slipped(const Tables<ScalarOf<T>>& t, const HeldLoop<ScalarOf<T>>& loop, int i, const Tile<T>& x) {
  const int r = loop.row + i;
  auto slips = is_at_limit(loop, i, x.loops.impulse[r]) | has_opened(loop, i, x.loops.gap[r]);
  if (t.solve_twice) slips = slips | is_at_limit(loop, i, x.loops.impulse[t.loops.rows + r]);
  return slips;
}

/// Changes x.stages.mean_velocity, which is about to move the positions of x.stages.begin. x.state.pose is where roots
/// are at the midpoint, and stays.
template <class T>
void close_loops(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Tables<S>& solve = *t.midpoint;
  const Columns& columns = t.rounds.columns;
  const T zero = T(0), most = T(S(fastest_closing) * t.step);

  add_loop_impulses(t, keeping_lanes(t, x), x);

  // The gaps where the step would end.
  for (int j = 0; j < t.joints; ++j)
    x.state.q[j] = fma(T(t.step), x.stages.mean_velocity[t.velocity_of(j)], x.stages.begin.q[j]);
  second_half_velocities(t, x);
  if (t.balls.count > 0) move_balls(t, t.step * S(0.5), x.state.v, x.stages.midpoint.q, x.state.q);
  if (t.functions.used()) place_curved_positions(t, x, x.state.q);
  for (int k = 0; k < 7 * t.roots.count; ++k) x.loops.pose[k] = x.state.pose[k];
  move_roots(t, x, t.step * S(0.5), x.state.v, x.loops.pose, x.state.pose);
  kinematics(t, x);
  move_bodies(t, x, x.loops.motion);
  loop_gaps(t, batch, x.loops.motion, x);
  for (int k = 0; k < 7 * t.roots.count; ++k) x.state.pose[k] = x.loops.pose[k];

  // H, with rows of couplings and loops, and J^T R^-1 C of the hard loops.
  for (int k = 0; k < columns.n; ++k) {
    x.held.diagonal[k] = x.held.matrix[columns.offset[k]];
    x.held.mask[k] = T::none();
    x.held.rhs[k] = x.held.goal[k] = x.rounds.step[k] = zero;
  }
  for (int r = 0; r < t.bounds.single; ++r) x.held.mask[t.rounds.velocity[r]] = x.loops.stays[r];
  copy_matrix(t, x);
  each_loop(solve, x, [&](const auto& loop, int, ActingRow<T>* rows) LOCKSTEP_INLINED {
    for (int i = 0; i < loop.rows(); ++i) rows[i].yields = has_slipped(solve, loop, i, x);
  });
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T* value) LOCKSTEP_INLINED {
    if (slot.bounded >= 0) return;
    const T stiff = T(1) / (larger(T(added_share<S>) * row.response, T(S(1e-30))) + row.cfm);
    const T gain = slot.loop >= 0 ? select(row.yields, zero, stiff) : stiff;
    const int* entry = t.rounds.term_entry.data + slot.entry;
    for (int k = 0; k < slot.last - slot.first; ++k) {
      const T share = gain * value[k];
      for (int l = 0; l <= k; ++l, ++entry) x.held.factor[*entry] = fma(share, value[l], x.held.factor[*entry]);
    }
    row.change = gain;
  });
  each_loop(solve, x, [&](const auto& loop, int, const ActingRow<T>* rows) LOCKSTEP_INLINED {
    for (int i = 0; i < loop.rows() && !loop.soft; ++i) {
      const T share = T(S(loop.rate) * solve.dt) * rows[i].change;
      const T impulse = share * clamp(x.loops.gap[loop.row + i], -most, most);
      const T* const value = x.loops.value + loop.value + i * loop.columns;
      for (int k = 0; k < loop.columns; ++k) {
        T& rhs = x.held.rhs[t.rounds.place[t.loops.columns[loop.column + k].velocity]];
        rhs = fnma(value[k], impulse, rhs);
      }
    }
  });
  factor_masked(t, x);
  solve_masked(t, position_phase, x.rounds.step, x);

  // As a velocity over the step.
  from_rounds(t, x.held.velocity, x.rounds.kept);
  expand(t, x, x.rounds.kept, x.dynamics.scratch, [](int, T following) LOCKSTEP_INLINED { return following; });
  for (int k = 0; k < t.velocities; ++k)
    x.stages.mean_velocity[k] = fma(T(S(1) / t.step), x.dynamics.scratch[k], x.stages.mean_velocity[k]);
}

}  // namespace lockstep::kernels
