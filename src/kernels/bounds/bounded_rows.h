// Bounded rows: which of them are active, and how they respond. SPDX-License-Identifier: Apache-2.0
//
// Section 12. A row is active lane by lane. A row that no lane of the tile violates costs one comparison. The result of
// a lane does not depend on the rows that other lanes need.
#pragma once

#include "projection.h"

namespace lockstep::kernels {

/// J z of a bounded row, for velocities z of the solver.
template <class T>
LOCKSTEP_INLINE T bound_speed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r, const T* z) {
  const Rows<ScalarOf<T>>& rows = t.bounds.rows;
  int k = rows.term_start[r];
  T sum = x.bounds.value[k] * z[rows.term_index[k]];
  while (++k < rows.term_start[r + 1]) sum = fma(x.bounds.value[k], z[rows.term_index[k]], sum);
  return sum;
}

/// Whether the row holds hard limits, which push one way.
template <class S>
LOCKSTEP_INLINE bool is_hard_limit(const Bounds<S>& b, int r) {
  return b.kind[r] == BoundKind::joint || (b.kind[r] == BoundKind::ball_range && !b.rows.softness[r].soft);
}

template <class T>
LOCKSTEP_INLINE int phases(const Tables<ScalarOf<T>>& t) {
  return t.solve_twice ? 2 : 1;
}

/// cfm of a row that has a softness: (M27), (M28).
template <class T>
LOCKSTEP_INLINE void soften_bound(const Tables<ScalarOf<T>>& t, int r, Tile<T>& x) {
  const RowSoftness<ScalarOf<T>>& softness = t.bounds.rows.softness[r];
  const int undamped = t.bounds.undamped_row[r];
  x.bounds.cfm[r] = T(softness.cfm);
  if (softness.cfm_per_response == 0) return;
  const T response = undamped >= 0 ? x.undamped.compliance[undamped] : x.bounds.own_response[r];
  x.bounds.cfm[r] = fma(T(softness.cfm_per_response), response, x.bounds.cfm[r]);
}

/// The row in one phase. In the velocity phase a kinematic drive that has given way asks for its relaxed target (M60).
template <class T>
LOCKSTEP_INLINE Bound<T> bound(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int r, Phase phase) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int count = b.rows.count, i = phase * count + r;
  if (b.kind[r] == BoundKind::joint) {
    T lo = x.bounds.lo[i], hi = x.bounds.hi[i];
    if (phase == velocity_phase && b.may_depend && b.kinematic[r]) {
      const auto gave_way = x.search.compliant[position_phase] | x.search.compliant[velocity_phase];
      lo = select(gave_way, x.bounds.relaxed_target[r], lo), hi = select(gave_way, x.bounds.relaxed_target[r], hi);
    }
    return {lo, hi, T(0), x.bounds.force[r], T(0)};
  }
  return {x.bounds.lo[i], x.bounds.hi[i], x.bounds.centre[i], x.bounds.force[r], x.bounds.cfm[r]};
}

/// Intervals and boxes of all rows in both phases. No row is active yet.
template <class T>
void open_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Bounds<S>& b = t.bounds;
  const T largest = T(largest_number<S>);
  x.bounds.invalid = T::none();
  for (int r = 0; r < b.rows.count; ++r) {
    x.bounds.active[r] = x.search.known[r] = x.search.known[b.rows.count + r] = T::none();
    for (int p = 0; p < phases<T>(t); ++p) {
      const StepTime<T> at{p == velocity_phase && t.velocity_iterations > 0, S(1) / t.dt};
      bounded_row(t, batch, r, Phase(p), at, T(0), x);
      const int i = p * b.rows.count + r;
      x.bounds.impulse[i] = T(0);
      x.search.branch[i] = {T::none(), T::none(), T::none(), T(0)};
      const T demand = x.bounds.lo[i] + x.bounds.hi[i] + x.bounds.force[r];
      x.bounds.invalid =
          x.bounds.invalid | beyond(b.kind[r] == BoundKind::joint ? demand : demand + x.bounds.centre[i], largest);
    }
  }
  x.bounds.active_count = 0;
  x.search.compliant[position_phase] = x.search.compliant[velocity_phase] = T::none();
  x.search.retries[position_phase] = x.search.retries[velocity_phase] = T(0);
}

/// X and D^-1 X of a row that becomes active, and its entries of K with the couplings and the other active rows.
template <class T>
void respond_to_bound(const Tables<ScalarOf<T>>& t, int r, Tile<T>& x) {
  const Rows<ScalarOf<T>>&bounds = t.bounds.rows, &rows = t.rows;
  const int n = t.solver.n, count = bounds.count;

  // Responses (M19) of the row, by paths where articulated bodies solve its trees.
  T* response = x.bounds.response + r * n;
  T* scaled = x.bounds.scaled_response + r * n;
  place_terms(bounds, r, n, x.bounds.value, response);
  const SupportRange* const support = bounds.support.data;
  if (const Path path = t.articulated.used() ? t.articulated.bounds[r] : Path{0, 0}; path.first < path.last)
    solve_inwards(t, x, path, response, 0);
  else
    respond<1>(support + bounds.support_start[r], support + bounds.support_start[r + 1], t.solver, x.dynamics.reduced,
               response, 0);
  scale_response(t, x, response, scaled);
  x.bounds.own_response[r] = supported_dot(bounds, r, response, scaled);
  soften_bound(t, r, x);

  const bool solved = rows.columns.n > 0;  // (M61): couplings that are solved, not swept
  T* cross_response = x.bounds.cross_response + r * rows.count;
  T* scaled_cross_response = x.bounds.scaled_cross_response + r * rows.count;
  for (int e = 0; e < rows.count; ++e) cross_response[e] = supported_dot(rows, e, x.rows.response + e * n, scaled);
  if (solved) {
    solve_upwards(rows.columns, all_of(rows.columns), x.rows.delassus, cross_response);
    for (int e = 0; e < rows.count; ++e) scaled_cross_response[e] = cross_response[e] * x.rows.inverse[e];
  }
  // Other lanes decide which of two rows comes first, so the order of the sum must not depend on it.
  const auto set_delassus = [&](int a, int b) {
    T sum = supported_dot(bounds, a, x.bounds.response + a * n, x.bounds.scaled_response + b * n);
    for (int e = 0; solved && e < rows.count; ++e)
      sum = fnma(x.bounds.cross_response[b * rows.count + e], x.bounds.scaled_cross_response[a * rows.count + e], sum);
    x.bounds.delassus[a * count + b] = x.bounds.delassus[b * count + a] = sum;
  };
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int other = x.bounds.active_rows[i];
    other < r ? set_delassus(other, r) : set_delassus(r, other);
  }
  set_delassus(r, r);
}

/// Activates the rows that velocities z of a phase violate. Returns whether a row has become active in some lane.
template <class T>
bool activate(const Tables<ScalarOf<T>>& t, Phase phase, const T* z, Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int count = b.rows.count;
  bool found = false;
  for (int r = 0; r < count; ++r) {
    const int i = phase * count + r;
    const T u = bound_speed(t, x, r, z);
    const auto violated = less(u, x.bounds.lo[i]) | less(x.bounds.hi[i], u) | less(T(0), x.bounds.force[r]);
    const auto newly_active = violated & x.bounds.candidate & ~x.bounds.active[r] & ~x.frozen;
    if (!any(newly_active)) continue;
    found = true;
    x.bounds.active[r] = x.bounds.active[r] | newly_active;
    x.bounds.newly_active[r] = 1;
  }
  return found;
}

/// Adds rows that have become active to the list of active rows, which is ascending, and finds their responses.
template <class T>
void list_active_rows(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  for (int r = 0; r < count; ++r) {
    if (!x.bounds.newly_active[r]) continue;
    x.bounds.newly_active[r] = 0;
    bool present = false;
    for (int i = 0; i < x.bounds.active_count; ++i) present |= x.bounds.active_rows[i] == r;
    if (present) continue;
    respond_to_bound(t, r, x);
    int place = x.bounds.active_count++;
    for (; place > 0 && x.bounds.active_rows[place - 1] > r; --place)
      x.bounds.active_rows[place] = x.bounds.active_rows[place - 1];
    x.bounds.active_rows[place] = r;
  }
}

/// Adds the bounded rows' impulses to half-solved velocities, in the lanes where these rows are active.
template <class T>
LOCKSTEP_INLINE void add_bounds(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, T* v) {
  const Rows<ScalarOf<T>>& rows = t.bounds.rows;
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    const T impulse = x.bounds.impulse[phase * rows.count + r];
    for (int k = rows.run_start[r]; k < rows.run_start[r + 1]; ++k)
      for (int z = rows.runs[k].first; z < rows.runs[k].last; ++z)
        v[z] = select(x.bounds.active[r], fma(x.bounds.scaled_response[r * t.solver.n + z], impulse, v[z]), v[z]);
  }
}

}  // namespace lockstep::kernels
