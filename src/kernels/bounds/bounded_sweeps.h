// Bounded rows in pgs and tgs: each sweep visits them after the couplings. SPDX-License-Identifier: Apache-2.0
//
// These are the sweeps of pgs.h and tgs.h, with the active bounded rows added.
#pragma once

#include "bounded_rows.h"
#include "kernels/couplings/sweep.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE bool is_hard(const Bounds<ScalarOf<T>>& b, int r) {
  return b.rows.softness[r].cfm == 0 && b.rows.softness[r].cfm_per_response == 0;
}

/// One sweep: couplings by (M34), bounded rows by (M55). In a sub-step, the box of a joint's row has the part `due` of
/// its force, because its impulse is that of all sub-steps so far. Other boxes have the part `share`.
template <class T>
void sweep_with_bounds(const Tables<ScalarOf<T>>& t, Phase phase, T due, T share, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.rows.count;
  const auto change_bounds = [&](auto response, T change) {
    for (int i = 0; i < x.bounds.active_count; ++i) {
      T& speed = x.bounds.speed[x.bounds.active_rows[i]];
      speed = fma(response(x.bounds.active_rows[i]), change, speed);
    }
  };
  for (int e = 0; e < rows.count; ++e) {
    const T change = visit(rows, e, x);
    change_bounds([&](int r) { return x.bounds.cross_response[r * rows.count + e]; }, change);
  }
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    const T response = x.bounds.delassus[r * count + r];
    const bool joint = is_hard_limit(t.bounds, r);
    Bound<T> row = bound(t, x, r, t.renewed && !is_hard<T>(t.bounds, r) ? position_phase : phase);
    row.force *= joint ? due : share;
    const T speed = fnma(response, x.search.impulse[r], x.bounds.speed[r]);
    const T impulse = select(x.bounds.active[r], project(row, speed, response).impulse, T(0));
    const T change = impulse - x.search.impulse[r];
    x.search.impulse[r] = impulse;
    for (int e = 0; e < rows.count; ++e)
      x.rows.residual[e] = fma(x.bounds.cross_response[r * rows.count + e], change, x.rows.residual[e]);
    change_bounds([&](int other) { return x.bounds.delassus[other * count + r]; }, change);
  }
}

/// Begins with the free motion. x.bounds.speed gets what the free motion adds in a step, without the speed at the
/// start.
template <class T>
void begin_sweeps(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  row_terms(t, x);
  for (int e = 0; e < t.rows.count; ++e) begin_row(x, e);
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    x.search.impulse[r] = T(0);
    x.bounds.speed[r] =
        supported_dot(t.bounds.rows, r, x.bounds.response + r * t.solver.n, x.dynamics.half_solved_position);
  }
}

template <class T>
void pgs_with_bounds(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.rows.count;
  begin_sweeps(t, x);
  for (int i = 0; i < x.bounds.active_count; ++i)
    x.bounds.speed[x.bounds.active_rows[i]] += bound_speed(t, x, x.bounds.active_rows[i], x.dynamics.start);
  const auto write_results = [&](Phase phase, T* row_impulse, T* row_speed) {
    for (int e = 0; e < rows.count; ++e) row_impulse[e] = x.rows.impulse[e], row_speed[e] = speed_of(x, e);
    for (int i = 0; i < x.bounds.active_count; ++i)
      x.bounds.impulse[phase * count + x.bounds.active_rows[i]] = x.search.impulse[x.bounds.active_rows[i]];
  };
  for (int s = 0; s < t.iterations; ++s) sweep_with_bounds(t, position_phase, T(1), T(1), x);
  write_results(position_phase, x.rows.position_impulse, x.rows.speed);
  for (int e = 0; e < rows.count; ++e) change_bias(x, e, velocity_phase_bias(t, x, e));
  for (int s = 0; s < t.velocity_iterations; ++s) sweep_with_bounds(t, velocity_phase, T(1), T(1), x);
  if (t.solve_twice) write_results(velocity_phase, x.rows.velocity_impulse, x.rows.velocity_phase_speed);
}

/// A joint's row is hard and pushes one way only. It must be able to take back what an earlier sub-step gave, so it has
/// one impulse for the whole step. Other rows begin each sub-step with zero impulse, as couplings do.
template <class T>
void tgs_with_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Rows<S>& rows = t.rows;
  const int count = t.bounds.rows.count;
  const T share = T(S(1) / S(t.iterations)), h = T(t.dt) * share;
  const StepTime<T> whole_step{false, S(1) / t.dt};
  const auto is_joint = [&](int r) { return is_hard_limit(t.bounds, r); };

  // The part of the free motion that each sub-step adds (M35), and the speeds at the start.
  begin_sweeps(t, x);
  for (int e = 0; e < rows.count; ++e) {
    x.rows.velocity_phase_speed[e] = (x.rows.speed[e] - x.rows.start[e]) * share;
    x.rows.speed[e] = x.rows.start[e];
    x.rows.position_impulse[e] = x.rows.velocity_impulse[e] = T(0);
  }
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    x.bounds.gain[r] = x.bounds.speed[r] * share;
    x.bounds.speed[r] = bound_speed(t, x, r, x.dynamics.start);
    x.bounds.moved[r] = x.bounds.impulse[r] = x.bounds.impulse[count + r] = T(0);
  }

  // Sub-steps: the part of the free motion, rows where their joints are by now, one sweep.
  for (int s = 0; s < t.iterations; ++s) {
    const StepTime<T> sub_step{false, S(t.iterations) / t.dt, S(s) / S(t.iterations) * t.dt, true};
    for (int e = 0; e < rows.count; ++e) {
      x.rows.speed[e] += x.rows.velocity_phase_speed[e];
      x.rows.bias[e] = x.rows.rate[e] * x.rows.error[e];
      begin_row(x, e);
    }
    for (int i = 0; i < x.bounds.active_count; ++i) {
      const int r = x.bounds.active_rows[i];
      x.bounds.speed[r] += x.bounds.gain[r];
      if (!is_joint(r)) x.search.impulse[r] = T(0);
      bounded_row(t, batch, r, position_phase, sub_step, x.bounds.moved[r], x);
    }
    sweep_with_bounds(t, position_phase, T(S(s + 1)) * share, share, x);

    // Impulses so far and their mean (M37), and where the rows have moved.
    const auto sum = [&](T impulse, T& total, T& mean) {
      total += impulse;
      mean = fma(share, total, mean);
    };
    for (int e = 0; e < rows.count; ++e) {
      sum(x.rows.impulse[e], x.rows.velocity_impulse[e], x.rows.position_impulse[e]);
      x.rows.speed[e] = speed_of(x, e);
      x.rows.error[e] = fma(h, x.rows.speed[e], x.rows.error[e]);
    }
    for (int i = 0; i < x.bounds.active_count; ++i) {
      const int r = x.bounds.active_rows[i];
      if (is_joint(r)) x.bounds.impulse[count + r] = T(0);
      sum(x.search.impulse[r], x.bounds.impulse[count + r], x.bounds.impulse[r]);
      x.bounds.moved[r] = fma(h, x.bounds.speed[r], x.bounds.moved[r]);
    }
  }

  // Velocity iterations go on from the last sub-step, whose impulses they change.
  for (int e = 0; e < rows.count; ++e) {
    x.rows.velocity_impulse[e] -= x.rows.impulse[e];
    change_bias(x, e, velocity_phase_bias(t, x, e));
  }
  for (int i = 0; i < x.bounds.active_count; ++i)
    x.bounds.impulse[count + x.bounds.active_rows[i]] -= x.search.impulse[x.bounds.active_rows[i]];
  for (int s = 0; s < t.velocity_iterations; ++s) sweep_with_bounds(t, velocity_phase, T(1), share, x);

  for (int e = 0; e < rows.count; ++e) x.rows.velocity_impulse[e] += x.rows.impulse[e];
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    x.bounds.impulse[count + r] += x.search.impulse[r];
    bounded_row(t, batch, r, position_phase, whole_step, T(0), x);  // as before the sub-steps
  }
}

}  // namespace lockstep::kernels
