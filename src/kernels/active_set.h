// Bounded rows solved exactly, through the couplings, by principal pivoting. SPDX-License-Identifier: Apache-2.0
//
// (M55), (M56). Each round assumes for every row which part of (M49) it is on, solves, and moves rows on that say
// otherwise: all of them at first, then the first one only (Murty), which cannot go round in circles. Lanes that have
// come to rest keep what they found while others go on, so no lane sees another's search.
#pragma once

#include "bounded_rows.h"

namespace lockstep::kernels {

constexpr int block_rounds = 8;     ///< in which all rows move at once
constexpr int rounds_per_row = 4;   ///< and then, for each row that takes part; what is open after them is swept
constexpr int rescue_sweeps = 50;

/// Relative size below which a row's condition is met.
template <class T>
LOCKSTEP_INLINE T rounding() {
  return T(ScalarOf<T>(sizeof(ScalarOf<T>) == 4 ? 4e-6 : 1e-14));
}

/// Speed of listed row i with all impulses.
template <class T>
LOCKSTEP_INLINE T felt_speed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i, T free, const T* impulse) {
  const int count = t.bounds.form.count, r = x.bound_listed[i];
  for (int k = 0; k < x.bound_count; ++k) free = fma(x.bound_coupled[r * count + x.bound_listed[k]], impulse[k], free);
  return free;
}

/// Dense L^T D L of the rows that are held, the others' impulses known: (M56). Answers in `impulse`.
template <class T>
void solve_held(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  using S = ScalarOf<T>;
  const int count = t.bounds.form.count, m = x.bound_count;
  const T zero = T(0), one = T(1);
  T* h = x.search_matrix;
  for (int i = 0; i < m; ++i) {
    const int r = x.bound_listed[i];
    const Bound<T> row = bound(t, x, r, phase);
    const Branch<T>& own = x.search_branch[i];
    const auto holds = held(own);
    T right = target(row, own) - x.bound_free[phase * count + r];
    for (int k = 0; k < m; ++k) {
      const Branch<T>& other = x.search_branch[k];
      const T coupled = x.bound_coupled[r * count + x.bound_listed[k]];
      right = select(held(other), right, fnma(coupled, other.impulse, right));
      if (k < i) h[i * m + k] = select(holds & held(other), coupled, zero);
    }
    h[i * m + i] = select(holds, x.bound_coupled[r * count + r] + compliance(row, own), one);
    impulse[i] = select(holds, right, own.impulse);
  }
  // From the last row to the first, as in (M17); a pivot of nothing but rounding takes no impulse.
  const T least = T(S(sizeof(S) == 4 ? 3e-7 : 1e-15));
  for (int i = m - 1; i >= 0; --i) {
    const T pivot = h[i * m + i];
    const auto sound = less(least * x.bound_own[x.bound_listed[i]], pivot) | ~held(x.search_branch[i]);
    const T inverse = select(sound, one / pivot, zero);
    x.search_inverse[i] = inverse;
    for (int a = i - 1; a >= 0; --a) {
      const T factor = h[i * m + a] * inverse;
      for (int b = 0; b <= a; ++b) h[a * m + b] = fnma(factor, h[i * m + b], h[a * m + b]);
      impulse[a] = fnma(factor, impulse[i], impulse[a]);
    }
  }
  for (int i = 0; i < m; ++i) {
    T sum = impulse[i];
    for (int k = 0; k < i; ++k) sum = fnma(h[i * m + k], impulse[k], sum);
    impulse[i] = sum * x.search_inverse[i];
  }
}

/// Moves rows on whose part of (M49) the impulses contradict. Returns the lanes in which none does.
template <class T>
typename T::Mask pivot(const Tables<ScalarOf<T>>& t, Phase phase, const T* impulse, bool one_by_one, Tile<T>& x) {
  const int count = t.bounds.form.count;
  T scale = T(0);
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    const T speed = felt_speed(t, x, i, x.bound_free[phase * count + r], impulse);
    const T weight = x.bound_coupled[r * count + r] * impulse[i];
    x.search_speed[i] = speed;
    const T size = larger(larger(weight, -weight), larger(speed, -speed));
    scale = select(x.bound_touched[r], larger(scale, size), scale);  // rows of neighbours have no say
  }
  typename T::Mask moved = T::none();
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    const Bound<T> row = bound(t, x, r, phase);
    const T yielding = fma(compliance(row, x.search_branch[i]), impulse[i], x.search_speed[i]);
    const T slack = rounding<T>() * scale;
    typename T::Mask changed;
    const Branch<T> next = advance_branch(row, x.search_branch[i], yielding, impulse[i], slack,
                                          slack / x.bound_coupled[r * count + r], changed);
    changed = changed & x.bound_touched[r];
    if (one_by_one) changed = changed & ~moved;
    moved = moved | changed;
    Branch<T>& own = x.search_branch[i];
    own.low = (own.low & ~changed) | (next.low & changed);
    own.high = (own.high & ~changed) | (next.high & changed);
    own.stuck = (own.stuck & ~changed) | (next.stuck & changed);
    own.impulse = select(changed, next.impulse, own.impulse);
  }
  return ~moved;
}

/// Sweeps of (M50) over the listed rows, which always converge, and keep to all bounds on the way.
template <class T>
void sweep_bounds(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  const int count = t.bounds.form.count;
  for (int i = 0; i < x.bound_count; ++i) impulse[i] = T(0);
  for (int s = 0; s < rescue_sweeps; ++s)
    for (int i = 0; i < x.bound_count; ++i) {
      const int r = x.bound_listed[i];
      const T response = x.bound_coupled[r * count + r];
      const T speed = felt_speed(t, x, i, x.bound_free[phase * count + r], impulse);
      const T wanted = project(bound(t, x, r, phase), fnma(response, impulse[i], speed), response).impulse;
      impulse[i] = select(x.bound_touched[r], wanted, T(0));
    }
}

template <class T>
void find_active_set(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.form.count, m = x.bound_count;
  T* impulse = x.search_impulse;
  typename T::Mask open = T::none();
  T rounds = T(ScalarOf<T>(block_rounds));  // of each lane, by the rows that it has itself
  for (int i = 0; i < m; ++i) {
    const int r = x.bound_listed[i];
    const auto touched = x.bound_touched[r];
    rounds += select(touched, T(ScalarOf<T>(rounds_per_row)), T(0));
    Branch<T> first = project(bound(t, x, r, phase), x.bound_free[phase * count + r], x.bound_coupled[r * count + r]);
    first.low = first.low & touched;
    first.high = first.high & touched;
    first.stuck = first.stuck & touched;
    first.impulse = select(touched & ~held(first), first.impulse, T(0));
    x.search_branch[i] = first;
    open = open | touched;
  }
  const auto keep = [&](typename T::Mask lanes) {
    for (int i = 0; i < m; ++i) {
      T& found = x.bound_impulse[phase * count + x.bound_listed[i]];
      found = select(lanes, impulse[i], found);
    }
  };
  typename T::Mask lost = T::none();
  for (int round = 0; any(open); ++round) {
    const auto late = open & ~less(T(ScalarOf<T>(round)), rounds);
    lost = lost | late;
    open = open & ~late;
    solve_held(t, phase, x, impulse);
    const auto rested = pivot(t, phase, impulse, round >= block_rounds, x) & open;
    keep(rested);
    open = open & ~rested;
  }
  if (!any(lost)) return;
  sweep_bounds(t, phase, x, impulse);
  keep(lost);
}

/// What the couplings' impulses give way to the bounded rows': (K_EE + cfm) dL_E = -K_EB L_B.
template <class T>
void yield_to_bounds(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* coupling_impulse) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.form.count;
  if (rows.count == 0) return;
  for (int e = 0; e < rows.count; ++e) x.scratch[e] = T(0);
  typename T::Mask touched = T::none();
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    touched = touched | x.bound_touched[r];
    const T impulse = x.bound_impulse[phase * count + r];
    for (int e = 0; e < rows.count; ++e)
      x.scratch[e] = fma(x.bound_through_scaled[r * rows.count + e], impulse, x.scratch[e]);
  }
  solve_downwards(rows.columns, x.coupled, x.scratch);
  for (int e = 0; e < rows.count; ++e)
    coupling_impulse[e] = select(touched, x.row_alone[phase * rows.count + e] - x.scratch[e], coupling_impulse[e]);
}

}  // namespace lockstep::kernels
