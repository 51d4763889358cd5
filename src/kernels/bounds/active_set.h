// Finds the active set of the bounded rows by principal pivoting. SPDX-License-Identifier: Apache-2.0
//
// (M60) to (M62). A round assumes for every row which part of (M54) it is on, solves, and moves the rows that the
// solution contradicts: all of them in the first rounds, later only the first one (Murty), which cannot cycle. A lane
// that has finished keeps its result while others go on, so no lane affects the search of another.
#pragma once

#include "bounded_rows.h"

namespace lockstep::kernels {

constexpr int first_sweeps = 2;    ///< sweeps that a search begins with
constexpr int block_rounds = 8;    ///< rounds in which all rows may move
constexpr int rounds_per_row = 4;  ///< further rounds for each active row of a lane
constexpr int most_retries = 3;    ///< searches that are repeated without compliance
constexpr int rescue_sweeps = 50;  ///< sweeps for lanes that ran out of rounds

/// epsilon behind (M59): compliance of rows that contradict each other, relative to their response. With it limits
/// share the violation, and kinematic drives give way to limits.
template <class S>
constexpr S limit_compliance = S(sizeof(S) == 4 ? 1e-4 : 1e-9);
template <class S>
constexpr S drive_compliance = S(sizeof(S) == 4 ? 1e-2 : 3e-7);

/// Speed of the i-th active row under all impulses, from its speed `free` without them.
template <class T>
LOCKSTEP_INLINE T speed_with_impulses(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i, T free, const T* impulse) {
  const int count = t.bounds.rows.count, r = x.bounds.active_rows[i];
  for (int k = 0; k < x.bounds.active_count; ++k)
    free = fma(x.bounds.delassus[r * count + x.bounds.active_rows[k]], impulse[k], free);
  return free;
}

/// Compliance of a joint's row that is held at an end of its interval, in the lanes where rows have turned out to
/// depend on each other.
template <class T>
LOCKSTEP_INLINE T conflict_compliance(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Phase phase, int r,
                                      const Branch<T>& own) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  using S = ScalarOf<T>;
  if (!is_hard_limit(b, r) || !b.may_depend) return T(0);
  const T compliance =
      T(b.kinematic[r] ? drive_compliance<S> : limit_compliance<S>) * x.bounds.delassus[r * b.rows.count + r];
  return select(x.search.compliant[phase] & (own.low | own.high), compliance, T(0));
}

/// (M62): solves the held rows by a dense L^T D L, with the known impulses of the others. Writes all impulses to
/// `impulse`. Rows that no lane holds need no elimination. Returns the lanes whose held rows have just turned out to
/// depend on each other: they have no solution yet, and get compliance from the next round on.
template <class T>
typename T::Mask solve_held(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x, T* impulse) {
  using S = ScalarOf<T>;
  const int count = t.bounds.rows.count, m = x.bounds.active_count;
  const T zero = T(0), one = T(1);
  T* h = x.search.matrix;
  T *known = x.search.speed, *noise = x.search.noise;
  const T epsilon = T(S(sizeof(S) == 4 ? 3e-7 : 1e-15)),
          least_share = T(t.bounds.may_depend ? limit_compliance<S> : S(0));

  // Which rows are held, and the impulses of the others.
  for (int i = 0; i < m; ++i) {
    const Branch<T>& own = x.search.branch[phase * count + x.bounds.active_rows[i]];
    x.search.held[i] = held(own);
    known[i] = select(x.search.held[i], zero, own.impulse);
  }

  // Matrix and right side (M62). A row that a lane does not hold has 1 on its diagonal there.
  for (int i = 0; i < m; ++i) {
    const auto holds = x.search.held[i];
    impulse[i] = known[i];
    if (!any(holds)) continue;
    const int r = x.bounds.active_rows[i];
    const Bound<T> row = bound(t, x, r, phase);
    const Branch<T>& own = x.search.branch[phase * count + r];
    const T* delassus = x.bounds.delassus + r * count;
    T rhs = target(row, own) - x.bounds.unbounded_speed[phase * count + r];
    for (int k = 0; k < m; ++k) rhs = fnma(delassus[x.bounds.active_rows[k]], known[k], rhs);
    for (int k = 0; k < i; ++k)
      h[i * m + k] = select(holds & x.search.held[k], delassus[x.bounds.active_rows[k]], zero);
    h[i * m + i] = select(holds, delassus[r] + row.cfm + conflict_compliance(t, x, phase, r, own), one);
    noise[i] = epsilon * x.bounds.own_response[r];
    impulse[i] = select(holds, rhs, known[i]);
  }

  // Eliminate from the last row to the first, as in (M17). A pivot that is only rounding takes no impulse. Where rows
  // may depend on each other, its floor replaces it: then the impulses show which joints cannot all stick. `noise` is
  // the rounding of the pivots. A small pivot passes on much of it to those that it is eliminated from.
  typename T::Mask dependent = T::none();
  for (int i = m - 1; i >= 0; --i) {
    if (!any(x.search.held[i])) continue;
    const int r = x.bounds.active_rows[i];
    const T pivot = h[i * m + i], floor = larger(noise[i], least_share * x.bounds.delassus[r * count + r]);
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

  // Substitute from the first row to the last.
  for (int i = 0; i < m; ++i) {
    if (!any(x.search.held[i])) continue;
    T sum = impulse[i];
    for (int k = 0; k < i; ++k) sum = fnma(h[i * m + k], impulse[k], sum);
    impulse[i] = sum * x.search.inverse[i];
  }
  if (!t.bounds.may_depend) return T::none();
  const auto newly_dependent = dependent & ~x.search.compliant[phase];
  x.search.compliant[phase] = x.search.compliant[phase] | newly_dependent;
  return newly_dependent;
}

/// Moves each row whose part of (M54) its impulse or speed contradicts. Returns the lanes in which no row moves. Lanes
/// that are `waiting` for a solution stay as they are.
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
    scale = select(x.bounds.active[r], larger(scale, size), scale);  // only rows that are active in the lane
  }
  typename T::Mask moved = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    const Bound<T> row = bound(t, x, r, phase);
    Branch<T>& own = x.search.branch[phase * count + r];
    const T softened_speed = fma(row.cfm, impulse[i], x.search.speed[i]);
    const T slack = rounding<T>() * scale;
    typename T::Mask changed;
    const Branch<T> next =
        advance_branch(row, own, softened_speed, impulse[i], slack, slack / x.bounds.delassus[r * count + r], changed);
    changed = changed & x.bounds.active[r] & ~waiting;
    if (one_by_one) changed = changed & ~moved;
    moved = moved | changed;
    replace(own, next, changed);
  }
  return ~moved & ~waiting;
}

/// Sweeps of (M55) over the active rows, which always converge and always leave admissible impulses. Lanes that have no
/// branch yet get the one at which a row arrives, in x.search.branch.
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
      const auto unknown = ~x.search.known[phase * count + r];
      own.low = (own.low & ~unknown) | (found.low & active & unknown);
      own.high = (own.high & ~unknown) | (found.high & active & unknown);
      own.stuck = (own.stuck & ~unknown) | (found.stuck & active & unknown);
      own.impulse = select(unknown, select(held(own), T(0), impulse[i]), own.impulse);
    }
}

/// Lanes in which a row has become active forget their earlier search. So their result does not depend on how often
/// other lanes made them search.
template <class T>
void forget_searches(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  typename T::Mask newly_active = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i)
    newly_active = newly_active | (x.bounds.active[x.bounds.active_rows[i]] & ~x.search.known[x.bounds.active_rows[i]]);
  for (int phase = position_phase; phase <= velocity_phase; ++phase) {
    for (int i = 0; i < x.bounds.active_count; ++i) {
      auto& known = x.search.known[phase * count + x.bounds.active_rows[i]];
      known = known & ~newly_active;
    }
    x.search.compliant[phase] = x.search.compliant[phase] & ~newly_active;
    x.search.retries[phase] = select(newly_active, T(0), x.search.retries[phase]);
  }
}

/// The velocity phase begins where the position phase ended, but a row that has to bounce slips instead of sticking.
/// Any other search begins with a few sweeps. A search that only other lanes repeat begins at its own end.
template <class T>
void begin_search(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  if (phase == position_phase) forget_searches(t, x);
  bool all_known = true;
  for (int i = 0; i < x.bounds.active_count; ++i) {
    const int r = x.bounds.active_rows[i];
    auto& known = x.search.known[phase * count + r];
    if (phase == velocity_phase) {
      const auto inherited = x.search.known[r] & ~known;
      Branch<T>& own = x.search.branch[count + r];
      const Branch<T>& before = x.search.branch[r];
      const Bound<T> row = bound(t, x, r, phase);
      const auto stuck = before.stuck & may_stick(row);
      const T slipping = select(less(-row.centre, row.lo), -row.force, row.force);
      const T known_impulse = select(before.stuck, slipping, clamp(before.impulse, -row.force, row.force));
      replace(own, {before.low, before.high, stuck, select(stuck, T(0), known_impulse)}, inherited);
      known = known | inherited;
    }
    all_known = all_known && !any(x.bounds.active[r] & ~known);
  }
  if (!all_known) sweep_bounds(t, phase, first_sweeps, x, x.search.impulse);
}

/// Searches in rounds until all lanes have finished (M62). Lanes that run out of rounds are swept.
template <class T>
void find_active_set(const Tables<ScalarOf<T>>& t, Phase phase, Tile<T>& x) {
  const int count = t.bounds.rows.count, m = x.bounds.active_count;
  T* impulse = x.search.impulse;
  begin_search(t, phase, x);

  // The lanes that search, and how many rounds each of them may take.
  typename T::Mask open = T::none();
  const int retry_rounds = t.bounds.may_depend ? 2 * most_retries : 0;
  T rounds = T(ScalarOf<T>(block_rounds + retry_rounds));  // of each lane, by the rows that are active in it
  for (int i = 0; i < m; ++i) {
    const auto active = x.bounds.active[x.bounds.active_rows[i]];
    rounds += select(active, T(ScalarOf<T>(rounds_per_row)), T(0));
    open = open | active;
  }
  const auto accept = [&](typename T::Mask lanes, typename T::Mask known) {
    for (int i = 0; i < m; ++i) {
      const int r = phase * count + x.bounds.active_rows[i];
      x.bounds.impulse[r] = select(lanes, impulse[i], x.bounds.impulse[r]);
      x.search.known[r] = (x.search.known[r] & ~lanes) | (known & x.bounds.active[x.bounds.active_rows[i]]);
    }
  };

  // Rounds. A lane that runs out of them takes the result of an earlier search, if there is one, or is swept.
  typename T::Mask unsolved = T::none(), has_fallback = T::none(), retry_rigid = T::none();
  T& retries = x.search.retries[phase];
  const T enough = T(ScalarOf<T>(most_retries));
  for (int round = 0; any(open); ++round) {
    const auto out_of_rounds = open & ~less(T(ScalarOf<T>(round)), rounds);
    unsolved = unsolved | (out_of_rounds & ~has_fallback);
    x.search.compliant[phase] = x.search.compliant[phase] | (out_of_rounds & has_fallback);
    open = open & ~out_of_rounds;

    // Solve, and move the rows that the solution contradicts.
    const auto waiting = solve_held(t, phase, x, impulse);
    retries = select(waiting & retry_rigid, enough, retries);
    auto finished = pivot(t, phase, impulse, round >= block_rounds, waiting, x) & open;

    // Rows that depend on each other on the way may not do so at the end. So a search that ends with compliance is
    // repeated without it. Its result is the fallback.
    retry_rigid = finished & x.search.compliant[phase] & less(retries, enough);
    accept(retry_rigid, T::none());
    has_fallback = has_fallback | retry_rigid;
    x.search.compliant[phase] = x.search.compliant[phase] & ~retry_rigid;
    retries += select(retry_rigid, T(1), T(0));
    finished = finished & ~retry_rigid;
    accept(finished, finished);
    open = open & ~finished;
  }

  // Lanes that found nothing are swept.
  if (!any(unsolved)) return;
  sweep_bounds(t, phase, rescue_sweeps, x, impulse);
  accept(unsolved, T::none());
  x.search.compliant[phase] = x.search.compliant[phase] & ~unsolved;
}

/// (M60): what kinematic drives that gave way ask for in the velocity phase.
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
    const T prescribed = x.bounds.lo[count + r], slowest = x.bounds.slowest[r];
    x.bounds.relaxed_target[r] = clamp(speed, smaller(slowest, prescribed), larger(slowest, prescribed));
  }
}

/// The couplings' impulses with those of the bounded rows: (K_EE + cfm) dL_E = -K_EB L_B.
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
  solve_downwards(rows.columns, all_of(rows.columns), x.rows.delassus, x.dynamics.scratch);
  for (int e = 0; e < rows.count; ++e)
    coupling_impulse[e] =
        select(active, x.bounds.unbounded_result[phase * rows.count + e] - x.dynamics.scratch[e], coupling_impulse[e]);
}

}  // namespace lockstep::kernels
