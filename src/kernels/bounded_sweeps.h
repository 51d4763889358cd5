// Bounded rows in pgs and tgs: visited after the couplings, and left at that. SPDX-License-Identifier: Apache-2.0
//
// The sweeps of pgs.h and tgs.h once more, with the rows that a lane of the tile needs among them.
#pragma once

#include "bounded_rows.h"
#include "sweep.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE bool is_hard(const Bounds<ScalarOf<T>>& b, int r) {
  return b.form.softness[r].cfm == 0 && b.form.softness[r].cfm_per_response == 0;
}

/// One sweep: couplings by (M34), bounded rows by (M55). In sub-steps boxes hold a share of their force: of joints, whose
/// rows keep their impulse over all sub-steps, what is due by then.
template <class T>
void sweep_with_bounds(const Tables<ScalarOf<T>>& t, Phase phase, T due, T share, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.form.count;
  const auto change_bounds = [&](auto coupled, T change) {
    for (int i = 0; i < x.bound_count; ++i) {
      T& speed = x.bound_now[x.bound_listed[i]];
      speed = fma(coupled(x.bound_listed[i]), change, speed);
    }
  };
  for (int e = 0; e < rows.count; ++e) {
    const T change = visit(rows, e, x);
    change_bounds([&](int r) { return x.bound_through[r * rows.count + e]; }, change);
  }
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    const T response = x.bound_coupled[r * count + r];
    const bool joint = t.bounds.kind[r] == BoundKind::joint;
    Bound<T> row = bound(t, x, r, t.renewed && !is_hard<T>(t.bounds, r) ? position_phase : phase);
    row.force *= joint ? due : share;
    const T speed = fnma(response, x.search_impulse[r], x.bound_now[r]);
    const T impulse = select(x.bound_touched[r], project(row, speed, response).impulse, T(0));
    const T change = impulse - x.search_impulse[r];
    x.search_impulse[r] = impulse;
    for (int e = 0; e < rows.count; ++e)
      x.row_residual[e] = fma(x.bound_through[r * rows.count + e], change, x.row_residual[e]);
    change_bounds([&](int other) { return x.bound_coupled[other * count + r]; }, change);
  }
}

/// Begins anew with the free motion: x.bound_now holds its part per step, not yet the speed at the start.
template <class T>
void begin_sweeps(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  row_terms(t, x);
  for (int e = 0; e < t.rows.count; ++e) begin_row(x, e);
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    x.search_impulse[r] = T(0);
    x.bound_now[r] = supported_dot(t.bounds.form, r, x.bound_response + r * t.solver.n, x.free_position);
  }
}

template <class T>
void pgs_with_bounds(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.form.count;
  begin_sweeps(t, x);
  for (int i = 0; i < x.bound_count; ++i) x.bound_now[x.bound_listed[i]] += bound_speed(t, x, x.bound_listed[i], x.start);
  const auto keep = [&](Phase phase, T* row_impulse, T* row_speed) {
    for (int e = 0; e < rows.count; ++e) row_impulse[e] = x.row_impulse[e], row_speed[e] = speed_of(x, e);
    for (int i = 0; i < x.bound_count; ++i)
      x.bound_impulse[phase * count + x.bound_listed[i]] = x.search_impulse[x.bound_listed[i]];
  };
  for (int s = 0; s < t.iterations; ++s) sweep_with_bounds(t, position_phase, T(1), T(1), x);
  keep(position_phase, x.position_impulse, x.row_speed);
  for (int e = 0; e < rows.count; ++e) change_bias(x, e, closing_bias(x, e));
  for (int s = 0; s < t.velocity_iterations; ++s) sweep_with_bounds(t, velocity_phase, T(1), T(1), x);
  if (t.solve_twice) keep(velocity_phase, x.velocity_impulse, x.row_speed_closed);
}

/// Joints' rows are hard and push one way only: what one sub-step gave another must be able to take back, so theirs is
/// one impulse for the whole step. Others begin each sub-step with none, as couplings do.
template <class T>
void tgs_with_bounds(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Rows<S>& rows = t.rows;
  const int count = t.bounds.form.count;
  const T share = T(S(1) / S(t.iterations)), h = T(t.dt) * share;
  const Moment<T> whole_step{false, S(1) / t.dt};
  const auto kept = [&](int r) { return t.bounds.kind[r] == BoundKind::joint; };
  begin_sweeps(t, x);
  for (int e = 0; e < rows.count; ++e) {
    x.row_speed_closed[e] = (x.row_speed[e] - x.row_start[e]) * share;
    x.row_speed[e] = x.row_start[e];
    x.position_impulse[e] = x.velocity_impulse[e] = T(0);
  }
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    x.bound_gain[r] = x.bound_now[r] * share;
    x.bound_now[r] = bound_speed(t, x, r, x.start);
    x.bound_moved[r] = x.bound_impulse[r] = x.bound_impulse[count + r] = T(0);
  }
  for (int s = 0; s < t.iterations; ++s) {
    const Moment<T> sub_step{false, S(t.iterations) / t.dt, S(s) / S(t.iterations) * t.dt, true};
    for (int e = 0; e < rows.count; ++e) {
      x.row_speed[e] += x.row_speed_closed[e];
      x.row_bias[e] = x.row_rate[e] * x.row_error[e];
      begin_row(x, e);
    }
    for (int i = 0; i < x.bound_count; ++i) {
      const int r = x.bound_listed[i];
      x.bound_now[r] += x.bound_gain[r];
      if (!kept(r)) x.search_impulse[r] = T(0);
      bounded_row(t, lanes, r, position_phase, sub_step, x.bound_moved[r], x);
    }
    sweep_with_bounds(t, position_phase, T(S(s + 1)) * share, share, x);
    const auto sum = [&](T impulse, T& closed, T& mean) {
      closed += impulse;
      mean = fma(share, closed, mean);
    };
    for (int e = 0; e < rows.count; ++e) {
      sum(x.row_impulse[e], x.velocity_impulse[e], x.position_impulse[e]);
      x.row_speed[e] = speed_of(x, e);
      x.row_error[e] = fma(h, x.row_speed[e], x.row_error[e]);
    }
    for (int i = 0; i < x.bound_count; ++i) {
      const int r = x.bound_listed[i];
      if (kept(r)) x.bound_impulse[count + r] = T(0);
      sum(x.search_impulse[r], x.bound_impulse[count + r], x.bound_impulse[r]);
      x.bound_moved[r] = fma(h, x.bound_now[r], x.bound_moved[r]);
    }
  }
  for (int e = 0; e < rows.count; ++e) {
    x.velocity_impulse[e] -= x.row_impulse[e];
    change_bias(x, e, closing_bias(x, e));
  }
  for (int i = 0; i < x.bound_count; ++i) x.bound_impulse[count + x.bound_listed[i]] -= x.search_impulse[x.bound_listed[i]];
  for (int s = 0; s < t.velocity_iterations; ++s) sweep_with_bounds(t, velocity_phase, T(1), share, x);
  for (int e = 0; e < rows.count; ++e) x.velocity_impulse[e] += x.row_impulse[e];
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    x.bound_impulse[count + r] += x.search_impulse[r];
    bounded_row(t, lanes, r, position_phase, whole_step, T(0), x);  // as it was found
  }
}

}  // namespace lockstep::kernels
