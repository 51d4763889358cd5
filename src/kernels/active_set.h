// Bounded rows solved exactly, through the couplings: semi-smooth Newton on the active set. SPDX-License-Identifier: Apache-2.0
//
// (M55), (M56). Lanes that have come to rest keep what they found while others go on, so no lane sees another's search.
#pragma once

#include "bounded_rows.h"

namespace lockstep::kernels {

constexpr int newton_rounds = 6;   ///< before sweeps give a new start
constexpr int search_rounds = 24;  ///< altogether; then the last sweep's impulses stand
constexpr int restart_sweeps = 8;

/// Relative size below which a row's condition is met.
template <class T>
LOCKSTEP_INLINE T rounding() {
  return T(ScalarOf<T>(sizeof(ScalarOf<T>) == 4 ? 2e-5 : 1e-13));
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
    const Branch<T>& own = x.search_branch[i];
    T right = own.target - x.bound_free[phase * count + r];
    for (int k = 0; k < m; ++k) {
      const Branch<T>& other = x.search_branch[k];
      const T coupled = x.bound_coupled[r * count + x.bound_listed[k]];
      right = select(other.held, right, fnma(coupled, other.impulse, right));
      if (k < i) h[i * m + k] = select(own.held & other.held, coupled, zero);
    }
    h[i * m + i] = select(own.held, x.bound_coupled[r * count + r] + own.cfm, one);
    impulse[i] = select(own.held, right, own.impulse);
  }
  // From the last row to the first, as in (M17); a pivot of nothing but rounding takes no impulse.
  const T least = T(S(sizeof(S) == 4 ? 3e-7 : 1e-15));
  for (int i = m - 1; i >= 0; --i) {
    const T pivot = h[i * m + i];
    const auto sound = less(least * x.bound_own[x.bound_listed[i]], pivot) | ~x.search_branch[i].held;
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

/// Sweeps of (M50) over the listed rows, from impulses that their bounds allow.
template <class T>
void sweep_bounds(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  const int count = t.bounds.form.count;
  for (int s = 0; s < restart_sweeps; ++s)
    for (int i = 0; i < x.bound_count; ++i) {
      const int r = x.bound_listed[i];
      const T response = x.bound_coupled[r * count + r];
      const T speed = felt_speed(t, x, i, x.bound_free[phase * count + r], impulse);
      const Branch<T> branch = project(bound(t, x, r, phase), fnma(response, impulse[i], speed), response);
      impulse[i] = select(x.bound_touched[r], branch.impulse, T(0));
    }
}

/// What (M50) says of every row at these impulses. Returns the lanes in which it is what was assumed.
template <class T>
typename T::Mask look(const Tables<ScalarOf<T>>& t, Phase phase, const T* impulse, Tile<T>& x) {
  const int count = t.bounds.form.count;
  T worst = T(0), scale = T(0);
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    const T response = x.bound_coupled[r * count + r];
    const T speed = felt_speed(t, x, i, x.bound_free[phase * count + r], impulse);
    Branch<T> branch = project(bound(t, x, r, phase), fnma(response, impulse[i], speed), response);
    const auto out = ~x.bound_touched[r];
    branch.held = branch.held & ~out;
    branch.impulse = select(out, T(0), branch.impulse);
    const T missing = (response + branch.cfm) * (branch.impulse - impulse[i]);
    const T weight = response * impulse[i];
    worst = larger(worst, larger(missing, -missing));
    scale = larger(scale, larger(larger(weight, -weight), larger(speed, -speed)));
    x.search_branch[i] = branch;
  }
  return ~less(rounding<T>() * scale, worst);
}

template <class T>
void find_active_set(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.form.count, m = x.bound_count;
  T* impulse = x.search_impulse;
  for (int i = 0; i < m; ++i) impulse[i] = T(0);
  typename T::Mask open = ~look(t, phase, impulse, x);
  for (int i = 0; i < m; ++i) x.bound_impulse[phase * count + x.bound_listed[i]] = T(0);
  for (int round = 0; round < search_rounds && any(open); ++round) {
    if (round >= newton_rounds) {
      for (int i = 0; i < m; ++i) impulse[i] = x.search_branch[i].impulse;
      sweep_bounds(t, phase, x, impulse);
      const auto rested = look(t, phase, impulse, x);
      for (int i = 0; i < m; ++i) {
        T& found = x.bound_impulse[phase * count + x.bound_listed[i]];
        found = select(open, impulse[i], found);
      }
      open = open & ~rested;
    }
    solve_held(t, phase, x, impulse);
    const auto rested = look(t, phase, impulse, x) & open;
    for (int i = 0; i < m; ++i) {
      T& found = x.bound_impulse[phase * count + x.bound_listed[i]];
      found = select(rested, impulse[i], found);
    }
    open = open & ~rested;
  }
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
