// Bounded rows solved exactly, through the couplings, by principal pivoting. SPDX-License-Identifier: Apache-2.0
//
// (M60) to (M62). Each round assumes for every row which part of (M54) it is on, solves, and moves rows on that say
// otherwise: all of them at first, then the first one only (Murty), which cannot go round in circles. StatePointers
// that have come to rest keep what they found while others go on, so no lane sees another's search.
#pragma once

#include "bounded_rows.h"

namespace lockstep::kernels {

constexpr int first_sweeps = 2;    ///< that the search begins with
constexpr int block_rounds = 8;    ///< in which all rows move at once
constexpr int rounds_per_row = 4;  ///< and then, for each row that takes part; what is open after them is swept
constexpr int most_retries = 3;    ///< whether an end needs its compliance
constexpr int rescue_sweeps = 50;

/// epsilon behind (M59), of what cannot all be had: limits share it, and kinematic drives give way to them.
template <class S>
constexpr S limit_compliance = S(sizeof(S) == 4 ? 1e-4 : 1e-9);
template <class S>
constexpr S drive_compliance = S(sizeof(S) == 4 ? 1e-2 : 3e-7);

/// Relative size below which a row's condition is met.
template <class T>
LOCKSTEP_INLINE T rounding() {
  return T(ScalarOf<T>(sizeof(ScalarOf<T>) == 4 ? 4e-6 : 1e-14));
}

/// Speed of listed row i with all impulses.
template <class T>
LOCKSTEP_INLINE T speed_with_impulses(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i, T free, const T* impulse) {
  const int count = t.bounds.rows.count, r = x.bounds.active_rows[i];
  for (int k = 0; k < x.bounds.active_count; ++k)
    free = fma(x.bounds.delassus[r * count + x.bounds.active_rows[k]], impulse[k], free);
  return free;
}

/// Compliance by which a joint's row that is held at an end of its interval shares what it cannot have with others, in
/// the lanes where rows have turned out to depend on each other.
template <class T>
LOCKSTEP_INLINE T conflict_compliance(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, int r,
                                      const Branch<T>& own) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  using S = ScalarOf<T>;
  if (b.kind[r] != BoundKind::joint || !b.may_depend) return T(0);
  const T share =
      T(b.kinematic[r] ? drive_compliance<S> : limit_compliance<S>) * x.bounds.delassus[r * b.rows.count + r];
  return select(x.search.compliant[phase] & (own.low | own.high), share, T(0));
}

/// Dense L^T D L of the rows that are held, the others' impulses known: (M62). Answers in `impulse`. Rows that no lane
/// holds have nothing to eliminate. Returns the lanes whose rows were found to depend on each other: they have no
/// answer yet, and share from the next time on.
template <class T>
typename T::Mask solve_held(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  using S = ScalarOf<T>;
  const int count = t.bounds.rows.count, m = x.bounds.active_count;
  const T zero = T(0), one = T(1);
  T* h = x.search.matrix;
  T *known = x.search.speed, *noise = x.search.noise;
  const T least = T(S(sizeof(S) == 4 ? 3e-7 : 1e-15)), shared = T(t.bounds.may_depend ? limit_compliance<S> : S(0));
  for (int i = 0; i < m; ++i) {
    const Branch<T>& own = x.search.branch[phase * count + x.bounds.active_rows[i]];
    x.search.held[i] = held(own);
    known[i] = select(x.search.held[i], zero, own.impulse);
  }
  for (int i = 0; i < m; ++i) {
    const auto holds = x.search.held[i];
    impulse[i] = known[i];
    if (!any(holds)) continue;
    const int r = x.bounds.active_rows[i];
    const Bound<T> row = bound(t, x, r, phase);
    const Branch<T>& own = x.search.branch[phase * count + r];
    const T* coupled = x.bounds.delassus + r * count;
    T right = target(row, own) - x.bounds.unbounded_speed[phase * count + r];
    for (int k = 0; k < m; ++k) right = fnma(coupled[x.bounds.active_rows[k]], known[k], right);
    for (int k = 0; k < i; ++k) h[i * m + k] = select(holds & x.search.held[k], coupled[x.bounds.active_rows[k]], zero);
    h[i * m + i] = select(holds, coupled[r] + row.cfm + conflict_compliance(t, x, phase, r, own), one);
    noise[i] = least * x.bounds.own_response[r];
    impulse[i] = select(holds, right, known[i]);
  }
  // From the last row to the first, as in (M17). A pivot of nothing but rounding takes no impulse; but where rows may
  // depend on each other it keeps the compliance, so that joints that cannot all stick find out. The rounding of a
  // small pivot grows in those that it is eliminated from.
  typename T::Mask dependent = T::none();
  for (int i = m - 1; i >= 0; --i) {
    if (!any(x.search.held[i])) continue;
    const int r = x.bounds.active_rows[i];
    const T pivot = h[i * m + i], floor = larger(noise[i], shared * x.bounds.delassus[r * count + r]);
    const auto weak = x.search.held[i] & ~less(floor, pivot);
    const T inverse = select(weak, t.bounds.may_depend ? one / floor : zero, one / pivot);
    dependent = dependent | weak;
    x.search.inverse[i] = inverse;
    for (int a = i - 1; a >= 0; --a) {
      if (!any(x.search.held[a])) continue;
      const T factor = h[i * m + a] * inverse;
      if (t.bounds.may_depend) noise[a] = fma(factor * factor, noise[i], noise[a]);
      for (int b = 0; b <= a; ++b) h[a * m + b] = fnma(factor, h[i * m + b], h[a * m + b]);
      impulse[a] = fnma(factor, impulse[i], impulse[a]);
    }
  }
  for (int i = 0; i < m; ++i) {
    if (!any(x.search.held[i])) continue;
    T sum = impulse[i];
    for (int k = 0; k < i; ++k) sum = fnma(h[i * m + k], impulse[k], sum);
    impulse[i] = sum * x.search.inverse[i];
  }
  if (!t.bounds.may_depend) return T::none();
  const auto found = dependent & ~x.search.compliant[phase];
  x.search.compliant[phase] = x.search.compliant[phase] | found;
  return found;
}

/// Moves rows on whose part of (M54) the impulses contradict. Returns the lanes in which none does.
/// StatePointers that are `waiting` for an answer stay where they are.
template <class T>
typename T::Mask pivot(const Tables<ScalarOf<T>>& t, Phase phase, const T* impulse, bool one_by_one,
                       typename T::Mask waiting, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  T scale = T(0);
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    const T speed = speed_with_impulses(t, x, i, x.bounds.unbounded_speed[phase * count + r], impulse);
    const T weight = x.bounds.delassus[r * count + r] * impulse[i];
    x.search.speed[i] = speed;
    const T size = larger(larger(weight, -weight), larger(speed, -speed));
    scale = select(x.bounds.active[r], larger(scale, size), scale);  // rows of neighbours have no say
  }
  typename T::Mask moved = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    const Bound<T> row = bound(t, x, r, phase);
    Branch<T>& own = x.search.branch[phase * count + r];
    const T yielding = fma(row.cfm, impulse[i], x.search.speed[i]);
    const T slack = rounding<T>() * scale;
    typename T::Mask changed;
    const Branch<T> next =
        advance_branch(row, own, yielding, impulse[i], slack, slack / x.bounds.delassus[r * count + r], changed);
    changed = changed & x.bounds.active[r] & ~waiting;
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
/// x.search.branch, where lanes have none yet, which part of (M54) each row came to.
template <class T>
void sweep_bounds(const Tables<ScalarOf<T>>& t, Phase phase, int sweeps, Tile<T>& x, T* impulse) {
  const int count = t.bounds.rows.count;
  for (int i = 0; i < x.bounds.active_count; ++i) impulse[i] = T(0);
  for (int s = 0; s < sweeps; ++s)
    for (int i = 0; i < x.bounds.active_count; ++i) {
      const int r = x.bounds.active_rows[i];
      const T response = x.bounds.delassus[r * count + r];
      const T speed = speed_with_impulses(t, x, i, x.bounds.unbounded_speed[phase * count + r], impulse);
      const auto active = x.bounds.active[r];
      Branch<T> found = project(bound(t, x, r, phase), fnma(response, impulse[i], speed), response);
      impulse[i] = select(active, found.impulse, T(0));
      Branch<T>& own = x.search.branch[phase * count + r];
      const auto fresh = ~x.search.known[phase * count + r];
      own.low = (own.low & ~fresh) | (found.low & active & fresh);
      own.high = (own.high & ~fresh) | (found.high & active & fresh);
      own.stuck = (own.stuck & ~fresh) | (found.stuck & active & fresh);
      own.impulse = select(fresh, select(held(own), T(0), impulse[i]), own.impulse);
    }
}

/// StatePointers in which a row has begun to take part forget how they searched without it, so that what they find does
/// not depend on how often neighbours made them search.
template <class T>
void forget_searches(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  typename T::Mask fresh = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i)
    fresh = fresh | (x.bounds.active[x.bounds.active_rows[i]] & ~x.search.known[x.bounds.active_rows[i]]);
  for (int phase = position_phase; phase <= velocity_phase; ++phase) {
    for (int i = 0; i < x.bounds.active_count; ++i) {
      auto& known = x.search.known[phase * count + x.bounds.active_rows[i]];
      known = known & ~fresh;
    }
    x.search.compliant[phase] = x.search.compliant[phase] & ~fresh;
    x.search.retries[phase] = select(fresh, T(0), x.search.retries[phase]);
  }
}

/// Where the search begins: for the velocity phase with what the position phase ended with, else with a few sweeps. A
/// search that is repeated for a neighbour's sake begins with its own end.
template <class T>
void begin_search(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  if (phase == position_phase) forget_searches(t, x);
  bool all_known = true;
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    auto& known = x.search.known[phase * count + r];
    if (phase == velocity_phase) {
      const auto taken = x.search.known[r] & ~known;
      Branch<T>& own = x.search.branch[count + r];
      const Branch<T>& before = x.search.branch[r];
      const T kept = x.bounds.force[r];
      own.low = (own.low & ~taken) | (before.low & taken);
      own.high = (own.high & ~taken) | (before.high & taken);
      own.stuck = (own.stuck & ~taken) | (before.stuck & taken);
      own.impulse = select(taken, clamp(before.impulse, -kept, kept), own.impulse);
      known = known | taken;
    }
    all_known = all_known && !any(x.bounds.active[r] & ~known);
  }
  if (!all_known) sweep_bounds(t, phase, first_sweeps, x, x.search.impulse);
}

template <class T>
void find_active_set(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.rows.count, m = x.bounds.active_count;
  T* impulse = x.search.impulse;
  begin_search(t, phase, x);
  typename T::Mask open = T::none();
  const int retry_rounds = t.bounds.may_depend ? 2 * most_retries : 0;
  T rounds = T(ScalarOf<T>(block_rounds + retry_rounds));  // of each lane, by the rows that it has itself
  for (int i = 0; i < m; ++i) {
    const auto active = x.bounds.active[x.bounds.active_rows[i]];
    rounds += select(active, T(ScalarOf<T>(rounds_per_row)), T(0));
    open = open | active;
  }
  const auto keep = [&](typename T::Mask lanes, typename T::Mask known) {
    for (int i = 0; i < m; ++i) {
      const int r = phase * count + x.bounds.active_rows[i];
      x.bounds.impulse[r] = select(lanes, impulse[i], x.bounds.impulse[r]);
      x.search.known[r] = (x.search.known[r] & ~lanes) | (known & x.bounds.active[x.bounds.active_rows[i]]);
    }
  };
  typename T::Mask lost = T::none(), has_fallback = T::none(), retry_rigid = T::none();
  T& doubts = x.search.retries[phase];
  const T enough = T(ScalarOf<T>(most_retries));
  for (int round = 0; any(open); ++round) {
    const auto late = open & ~less(T(ScalarOf<T>(round)), rounds);
    lost = lost | (late & ~has_fallback);
    x.search.compliant[phase] = x.search.compliant[phase] | (late & has_fallback);
    open = open & ~late;
    const auto waiting = solve_held(t, phase, x, impulse);
    doubts = select(waiting & retry_rigid, enough, doubts);
    auto rested = pivot(t, phase, impulse, round >= block_rounds, waiting, x) & open;
    // Rows that depended on each other on the way need not do so at its end: it is asked again without compliance.
    retry_rigid = rested & x.search.compliant[phase] & less(doubts, enough);
    keep(retry_rigid, T::none());
    has_fallback = has_fallback | retry_rigid;
    x.search.compliant[phase] = x.search.compliant[phase] & ~retry_rigid;
    doubts += select(retry_rigid, T(1), T(0));
    rested = rested & ~retry_rigid;
    keep(rested, rested);
    open = open & ~rested;
  }
  if (!any(lost)) return;
  sweep_bounds(t, phase, rescue_sweeps, x, impulse);
  keep(lost, T::none());
  x.search.compliant[phase] = x.search.compliant[phase] & ~lost;
}

/// (M60)
template <class T>
void relax_drives(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  if (!t.bounds.may_depend) return;
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    if (!t.bounds.kinematic[r]) continue;
    T speed = x.bounds.unbounded_speed[r] + x.bounds.correction[r];
    for (int k = 0; k < x.bounds.active_count; ++k) {
      const int other = x.bounds.active_rows[k];
      speed = fma(x.bounds.delassus[r * count + other], x.bounds.impulse[other], speed);
    }
    const T asked = x.bounds.lo[count + r], least = x.bounds.slowest[r];
    x.bounds.relaxed_target[r] = clamp(speed, smaller(least, asked), larger(least, asked));
  }
}

/// What the couplings' impulses give way to the bounded rows': (K_EE + cfm) dL_E = -K_EB L_B.
template <class T>
void back_substitute_couplings(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* coupling_impulse) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int count = t.bounds.rows.count;
  if (rows.count == 0) return;
  for (int e = 0; e < rows.count; ++e) x.dynamics.scratch[e] = T(0);
  typename T::Mask active = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    active = active | x.bounds.active[r];
    const T impulse = x.bounds.impulse[phase * count + r];
    for (int e = 0; e < rows.count; ++e)
      x.dynamics.scratch[e] = fma(x.bounds.scaled_cross_response[r * rows.count + e], impulse, x.dynamics.scratch[e]);
  }
  solve_downwards(rows.columns, x.rows.delassus, x.dynamics.scratch);
  for (int e = 0; e < rows.count; ++e)
    coupling_impulse[e] =
        select(active, x.bounds.unbounded_result[phase * rows.count + e] - x.dynamics.scratch[e], coupling_impulse[e]);
}

}  // namespace lockstep::kernels
