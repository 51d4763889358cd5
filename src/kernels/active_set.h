// Bounded rows solved exactly, through the couplings, by principal pivoting. SPDX-License-Identifier: Apache-2.0
//
// (M60) to (M62). Each round assumes for every row which part of (M54) it is on, solves, and moves rows on that say
// otherwise: all of them at first, then the first one only (Murty), which cannot go round in circles. Lanes that have
// come to rest keep what they found while others go on, so no lane sees another's search.
#pragma once

#include "bounded_rows.h"

namespace lockstep::kernels {

constexpr int first_sweeps = 2;     ///< that the search begins with
constexpr int block_rounds = 8;     ///< in which all rows move at once
constexpr int rounds_per_row = 4;   ///< and then, for each row that takes part; what is open after them is swept
constexpr int most_doubts = 3;      ///< whether an end needs its compliance
constexpr int rescue_sweeps = 50;

/// epsilon behind (M59), of what cannot all be had: limits share it, and kinematic drives give way to them.
template <class S>
constexpr S limits_yield = S(sizeof(S) == 4 ? 1e-4 : 1e-9);
template <class S>
constexpr S drives_yield = S(sizeof(S) == 4 ? 1e-2 : 3e-7);

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

/// Compliance by which a joint's row that is held at an end of its interval shares what it cannot have with others, in
/// the lanes where rows have turned out to depend on each other.
template <class T>
LOCKSTEP_INLINE T sharing(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, int r, const Branch<T>& own) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  using S = ScalarOf<T>;
  if (b.kind[r] != BoundKind::joint || !b.may_depend) return T(0);
  const T share = T(b.driven[r] ? drives_yield<S> : limits_yield<S>) * x.bound_coupled[r * b.form.count + r];
  return select(x.search_shared[phase] & (own.low | own.high), share, T(0));
}

/// Dense L^T D L of the rows that are held, the others' impulses known: (M62). Answers in `impulse`. Rows that no lane
/// holds have nothing to eliminate. Returns the lanes whose rows were found to depend on each other: they have no answer
/// yet, and share from the next time on.
template <class T>
typename T::Mask solve_held(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  using S = ScalarOf<T>;
  const int count = t.bounds.form.count, m = x.bound_count;
  const T zero = T(0), one = T(1);
  T* h = x.search_matrix;
  T *known = x.search_speed, *noise = x.search_noise;
  const T least = T(S(sizeof(S) == 4 ? 3e-7 : 1e-15)), shared = T(t.bounds.may_depend ? limits_yield<S> : S(0));
  for (int i = 0; i < m; ++i) {
    const Branch<T>& own = x.search_branch[phase * count + x.bound_listed[i]];
    x.search_held[i] = held(own);
    known[i] = select(x.search_held[i], zero, own.impulse);
  }
  for (int i = 0; i < m; ++i) {
    const auto holds = x.search_held[i];
    impulse[i] = known[i];
    if (!any(holds)) continue;
    const int r = x.bound_listed[i];
    const Bound<T> row = bound(t, x, r, phase);
    const Branch<T>& own = x.search_branch[phase * count + r];
    const T* coupled = x.bound_coupled + r * count;
    T right = target(row, own) - x.bound_free[phase * count + r];
    for (int k = 0; k < m; ++k) right = fnma(coupled[x.bound_listed[k]], known[k], right);
    for (int k = 0; k < i; ++k) h[i * m + k] = select(holds & x.search_held[k], coupled[x.bound_listed[k]], zero);
    h[i * m + i] = select(holds, coupled[r] + row.cfm + sharing(t, x, phase, r, own), one);
    noise[i] = least * x.bound_own[r];
    impulse[i] = select(holds, right, known[i]);
  }
  // From the last row to the first, as in (M17). A pivot of nothing but rounding takes no impulse; but where rows may
  // depend on each other it keeps the compliance, so that joints that cannot all stick find out. The rounding of a small
  // pivot grows in those that it is eliminated from.
  typename T::Mask dependent = T::none();
  for (int i = m - 1; i >= 0; --i) {
    if (!any(x.search_held[i])) continue;
    const int r = x.bound_listed[i];
    const T pivot = h[i * m + i], floor = larger(noise[i], shared * x.bound_coupled[r * count + r]);
    const auto weak = x.search_held[i] & ~less(floor, pivot);
    const T inverse = select(weak, t.bounds.may_depend ? one / floor : zero, one / pivot);
    dependent = dependent | weak;
    x.search_inverse[i] = inverse;
    for (int a = i - 1; a >= 0; --a) {
      if (!any(x.search_held[a])) continue;
      const T factor = h[i * m + a] * inverse;
      if (t.bounds.may_depend) noise[a] = fma(factor * factor, noise[i], noise[a]);
      for (int b = 0; b <= a; ++b) h[a * m + b] = fnma(factor, h[i * m + b], h[a * m + b]);
      impulse[a] = fnma(factor, impulse[i], impulse[a]);
    }
  }
  for (int i = 0; i < m; ++i) {
    if (!any(x.search_held[i])) continue;
    T sum = impulse[i];
    for (int k = 0; k < i; ++k) sum = fnma(h[i * m + k], impulse[k], sum);
    impulse[i] = sum * x.search_inverse[i];
  }
  if (!t.bounds.may_depend) return T::none();
  const auto found = dependent & ~x.search_shared[phase];
  x.search_shared[phase] = x.search_shared[phase] | found;
  return found;
}

/// Moves rows on whose part of (M54) the impulses contradict. Returns the lanes in which none does.
/// Lanes that are `waiting` for an answer stay where they are.
template <class T>
typename T::Mask pivot(const Tables<ScalarOf<T>>& t, Phase phase, const T* impulse, bool one_by_one,
                       typename T::Mask waiting, Tile<T>& x) {
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
    Branch<T>& own = x.search_branch[phase * count + r];
    const T yielding = fma(row.cfm, impulse[i], x.search_speed[i]);
    const T slack = rounding<T>() * scale;
    typename T::Mask changed;
    const Branch<T> next =
        advance_branch(row, own, yielding, impulse[i], slack, slack / x.bound_coupled[r * count + r], changed);
    changed = changed & x.bound_touched[r] & ~waiting;
    if (one_by_one) changed = changed & ~moved;
    moved = moved | changed;
    own.low = (own.low & ~changed) | (next.low & changed);
    own.high = (own.high & ~changed) | (next.high & changed);
    own.stuck = (own.stuck & ~changed) | (next.stuck & changed);
    own.impulse = select(changed, next.impulse, own.impulse);
  }
  return ~moved & ~waiting;
}

/// Sweeps of (M55) over the listed rows, which always converge, and keep to all bounds on the way. Leaves in
/// x.search_branch, where lanes have none yet, which part of (M54) each row came to.
template <class T>
void sweep_bounds(const Tables<ScalarOf<T>>& t, Phase phase, int sweeps, Tile<T>& x, T* impulse) {
  const int count = t.bounds.form.count;
  for (int i = 0; i < x.bound_count; ++i) impulse[i] = T(0);
  for (int s = 0; s < sweeps; ++s)
    for (int i = 0; i < x.bound_count; ++i) {
      const int r = x.bound_listed[i];
      const T response = x.bound_coupled[r * count + r];
      const T speed = felt_speed(t, x, i, x.bound_free[phase * count + r], impulse);
      const auto touched = x.bound_touched[r];
      Branch<T> found = project(bound(t, x, r, phase), fnma(response, impulse[i], speed), response);
      impulse[i] = select(touched, found.impulse, T(0));
      Branch<T>& own = x.search_branch[phase * count + r];
      const auto fresh = ~x.bound_known[phase * count + r];
      own.low = (own.low & ~fresh) | (found.low & touched & fresh);
      own.high = (own.high & ~fresh) | (found.high & touched & fresh);
      own.stuck = (own.stuck & ~fresh) | (found.stuck & touched & fresh);
      own.impulse = select(fresh, select(held(own), T(0), impulse[i]), own.impulse);
    }
}

/// Lanes in which a row has begun to take part forget how they searched without it, so that what they find does not
/// depend on how often neighbours made them search.
template <class T>
void forget_searches(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.form.count;
  typename T::Mask fresh = T::none();
  for (int i = 0; i < x.bound_count; ++i)
    fresh = fresh | (x.bound_touched[x.bound_listed[i]] & ~x.bound_known[x.bound_listed[i]]);
  for (int phase = position_phase; phase <= velocity_phase; ++phase) {
    for (int i = 0; i < x.bound_count; ++i) {
      auto& known = x.bound_known[phase * count + x.bound_listed[i]];
      known = known & ~fresh;
    }
    x.search_shared[phase] = x.search_shared[phase] & ~fresh;
    x.search_doubts[phase] = select(fresh, T(0), x.search_doubts[phase]);
  }
}

/// Where the search begins: for the velocity phase with what the position phase ended with, else with a few sweeps. A
/// search that is repeated for a neighbour's sake begins with its own end.
template <class T>
void begin_search(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.form.count;
  if (phase == position_phase) forget_searches(t, x);
  bool all_known = true;
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    auto& known = x.bound_known[phase * count + r];
    if (phase == velocity_phase) {
      const auto taken = x.bound_known[r] & ~known;
      Branch<T>& own = x.search_branch[count + r];
      const Branch<T>& before = x.search_branch[r];
      const T kept = x.bound_force[r];
      own.low = (own.low & ~taken) | (before.low & taken);
      own.high = (own.high & ~taken) | (before.high & taken);
      own.stuck = (own.stuck & ~taken) | (before.stuck & taken);
      own.impulse = select(taken, clamp(before.impulse, -kept, kept), own.impulse);
      known = known | taken;
    }
    all_known = all_known && !any(x.bound_touched[r] & ~known);
  }
  if (!all_known) sweep_bounds(t, phase, first_sweeps, x, x.search_impulse);
}

template <class T>
void find_active_set(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.form.count, m = x.bound_count;
  T* impulse = x.search_impulse;
  begin_search(t, phase, x);
  typename T::Mask open = T::none();
  const int asking_takes = t.bounds.may_depend ? 2 * most_doubts : 0;
  T rounds = T(ScalarOf<T>(block_rounds + asking_takes));  // of each lane, by the rows that it has itself
  for (int i = 0; i < m; ++i) {
    const auto touched = x.bound_touched[x.bound_listed[i]];
    rounds += select(touched, T(ScalarOf<T>(rounds_per_row)), T(0));
    open = open | touched;
  }
  const auto keep = [&](typename T::Mask lanes, typename T::Mask known) {
    for (int i = 0; i < m; ++i) {
      const int r = phase * count + x.bound_listed[i];
      x.bound_impulse[r] = select(lanes, impulse[i], x.bound_impulse[r]);
      x.bound_known[r] = (x.bound_known[r] & ~lanes) | (known & x.bound_touched[x.bound_listed[i]]);
    }
  };
  typename T::Mask lost = T::none(), answered = T::none(), asking = T::none();
  T& doubts = x.search_doubts[phase];
  const T enough = T(ScalarOf<T>(most_doubts));
  for (int round = 0; any(open); ++round) {
    const auto late = open & ~less(T(ScalarOf<T>(round)), rounds);
    lost = lost | (late & ~answered);
    x.search_shared[phase] = x.search_shared[phase] | (late & answered);
    open = open & ~late;
    const auto waiting = solve_held(t, phase, x, impulse);
    doubts = select(waiting & asking, enough, doubts);
    auto rested = pivot(t, phase, impulse, round >= block_rounds, waiting, x) & open;
    // Rows that depended on each other on the way need not do so at its end: it is asked again without compliance.
    asking = rested & x.search_shared[phase] & less(doubts, enough);
    keep(asking, T::none());
    answered = answered | asking;
    x.search_shared[phase] = x.search_shared[phase] & ~asking;
    doubts += select(asking, T(1), T(0));
    rested = rested & ~asking;
    keep(rested, rested);
    open = open & ~rested;
  }
  if (!any(lost)) return;
  sweep_bounds(t, phase, rescue_sweeps, x, impulse);
  keep(lost, T::none());
  x.search_shared[phase] = x.search_shared[phase] & ~lost;
}

/// (M60)
template <class T>
void ease_drives(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.form.count;
  if (!t.bounds.may_depend) return;
  for (int i = 0; i < x.bound_count; ++i) {
    const int r = x.bound_listed[i];
    if (!t.bounds.driven[r]) continue;
    T speed = x.bound_free[r] + x.bound_pushed[r];
    for (int k = 0; k < x.bound_count; ++k) {
      const int other = x.bound_listed[k];
      speed = fma(x.bound_coupled[r * count + other], x.bound_impulse[other], speed);
    }
    const T asked = x.bound_lo[count + r], least = x.bound_slowest[r];
    x.bound_eased[r] = clamp(speed, smaller(least, asked), larger(least, asked));
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
    coupling_impulse[e] = select(touched, x.alone[phase * rows.count + e] - x.scratch[e], coupling_impulse[e]);
}

}  // namespace lockstep::kernels
