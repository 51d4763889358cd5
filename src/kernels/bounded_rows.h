// Bounded rows: which of them an environment has come to violate, and what these feel. SPDX-License-Identifier: Apache-2.0
//
// Section 12. Rows take part lane by lane: a row that no lane of the tile violates costs a comparison, and a lane's
// result does not depend on which rows its neighbours need.
#pragma once

#include "projection.h"

namespace lockstep::kernels {

/// J z of a bounded row, from velocities of the solver.
template <class T>
LOCKSTEP_INLINE T bound_speed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r, const T* z) {
  const Rows<ScalarOf<T>>& form = t.bounds.form;
  int k = form.term_start[r];
  T sum = x.bound_value[k] * z[form.term_index[k]];
  while (++k < form.term_start[r + 1]) sum = fma(x.bound_value[k], z[form.term_index[k]], sum);
  return sum;
}

template <class T>
LOCKSTEP_INLINE int phases(const Tables<ScalarOf<T>>& t) {
  return t.solve_twice ? 2 : 1;
}

/// Softness of the rows that have one: (M27), (M28).
template <class T>
LOCKSTEP_INLINE void soften_bound(const Tables<ScalarOf<T>>& t, int r, Tile<T>& x) {
  const RowSoftness<ScalarOf<T>>& softness = t.bounds.form.softness[r];
  const int natural = t.bounds.natural_row[r];
  x.bound_cfm[r] = T(softness.cfm);
  if (softness.cfm_per_response == 0) return;
  const T response = natural >= 0 ? x.natural_compliance[natural] : x.bound_own[r];
  x.bound_cfm[r] = fma(T(softness.cfm_per_response), response, x.bound_cfm[r]);
}

/// The row as one phase asks it. A kinematic drive that cannot have its way does not insist in the velocity phase (M60).
template <class T>
LOCKSTEP_INLINE Bound<T> bound(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r, Phase phase) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int count = b.form.count, i = phase * count + r;
  if (b.kind[r] == BoundKind::joint) {
    T lo = x.bound_lo[i], hi = x.bound_hi[i];
    if (phase == velocity_phase && b.may_depend && b.driven[r]) {
      const auto shared = x.search_shared[position_phase] | x.search_shared[velocity_phase];
      lo = select(shared, x.bound_eased[r], lo), hi = select(shared, x.bound_eased[r], hi);
    }
    return {lo, hi, T(0), x.bound_force[r], T(0)};
  }
  return {x.bound_lo[i], x.bound_hi[i], x.bound_centre[i], x.bound_force[r], x.bound_cfm[r]};
}

/// Intervals and boxes of all rows for both phases, before any of them has an impulse.
template <class T>
void open_bounds(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const T largest = T(largest_number<S>);
  x.senseless = T::none();
  for (int r = 0; r < b.form.count; ++r) {
    x.bound_touched[r] = x.bound_known[r] = x.bound_known[b.form.count + r] = T::none();
    for (int p = 0; p < phases<T>(t); ++p) {
      const Moment<T> at{p == velocity_phase && t.velocity_iterations > 0, S(1) / t.dt};
      bounded_row(t, lanes, r, Phase(p), at, T(0), x);
      const int i = p * b.form.count + r;
      x.bound_impulse[i] = T(0);
      x.search_branch[i] = {T::none(), T::none(), T::none(), T(0)};
      const T demand = x.bound_lo[i] + x.bound_hi[i] + x.bound_force[r];
      x.senseless = x.senseless | beyond(b.kind[r] == BoundKind::joint ? demand : demand + x.bound_centre[i], largest);
    }
  }
  x.bound_count = 0;
  x.search_shared[position_phase] = x.search_shared[velocity_phase] = T::none();
  x.search_doubts[position_phase] = x.search_doubts[velocity_phase] = T(0);
}

/// X and D^-1 X of a row that begins to take part, and what it feels of the others that do, couplings included.
template <class T>
void respond_to_bound(const Tables<ScalarOf<T>>& t, int r, Tile<T>& x) {
  const Rows<ScalarOf<T>>&form = t.bounds.form, &rows = t.rows;
  const int n = t.solver.n, count = form.count;
  T* response = x.bound_response + r * n;
  T* scaled = x.bound_scaled + r * n;
  place_terms(form, r, n, x.bound_value, response);
  const SupportRange* const support = form.support.data;
  if (t.articulated.used())
    solve_inwards(t, x, t.articulated.bound[r], response, 0);
  else
    respond<1>(support + form.support_start[r], support + form.support_start[r + 1], t.solver, x.reduced, response, 0);
  scale_response(t, x, response, scaled);
  x.bound_own[r] = supported_dot(form, r, response, scaled);
  soften_bound(t, r, x);

  const bool solved = rows.columns.n > 0;  // (M61): through couplings that are solved, not swept
  T* through = x.bound_through + r * rows.count;
  T* through_scaled = x.bound_through_scaled + r * rows.count;
  for (int e = 0; e < rows.count; ++e) through[e] = supported_dot(rows, e, x.response + e * n, scaled);
  if (solved) {
    solve_upwards(rows.columns, x.coupled, through);
    for (int e = 0; e < rows.count; ++e) through_scaled[e] = through[e] * x.row_inverse[e];
  }
  // Which of two rows came first is a matter of the neighbours as well, so sums may not depend on it.
  const auto felt = [&](int a, int b) {
    T sum = supported_dot(form, a, x.bound_response + a * n, x.bound_scaled + b * n);
    for (int e = 0; solved && e < rows.count; ++e)
      sum = fnma(x.bound_through[b * rows.count + e], x.bound_through_scaled[a * rows.count + e], sum);
    x.bound_coupled[a * count + b] = x.bound_coupled[b * count + a] = sum;
  };
  for (int i = 0; i < x.bound_count; ++i) {
    const int other = x.bound_listed[i];
    other < r ? felt(other, r) : felt(r, other);
  }
  felt(r, r);
}

/// Finds the rows that velocities z of a phase violate; true if a lane has a row to take part that did not.
template <class T>
bool touch(const Tables<ScalarOf<T>>& t, Phase phase, const T* z, Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int count = b.form.count;
  bool found = false;
  for (int r = 0; r < count; ++r) {
    const int i = phase * count + r;
    const T u = bound_speed(t, x, r, z);
    const auto violated = less(u, x.bound_lo[i]) | less(x.bound_hi[i], u) | less(T(0), x.bound_force[r]);
    const auto fresh = violated & x.suspect & ~x.bound_touched[r] & ~x.frozen;
    if (!any(fresh)) continue;
    found = true;
    x.bound_touched[r] = x.bound_touched[r] | fresh;
    x.bound_fresh[r] = 1;
  }
  return found;
}

/// Lists the rows that a lane of the tile needs, in their order.
template <class T>
void list_bounds(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.form.count;
  for (int r = 0; r < count; ++r) {
    if (!x.bound_fresh[r]) continue;
    x.bound_fresh[r] = 0;
    bool listed = false;
    for (int i = 0; i < x.bound_count; ++i) listed |= x.bound_listed[i] == r;
    if (listed) continue;
    respond_to_bound(t, r, x);
    int place = x.bound_count++;
    for (; place > 0 && x.bound_listed[place - 1] > r; --place) x.bound_listed[place] = x.bound_listed[place - 1];
    x.bound_listed[place] = r;
  }
}

/// Adds the bounded rows' impulses to half-solved velocities, where lanes have any.
template <class T>
LOCKSTEP_INLINE void add_bounds(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, T* v) {
  const Rows<ScalarOf<T>>& form = t.bounds.form;
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    const T impulse = x.bound_impulse[phase * form.count + r];
    for (int k = form.run_start[r]; k < form.run_start[r + 1]; ++k)
      for (int z = form.runs[k].first; z < form.runs[k].last; ++z)
        v[z] = select(x.bound_touched[r], fma(x.bound_scaled[r * t.solver.n + z], impulse, v[z]), v[z]);
  }
}

}  // namespace lockstep::kernels
