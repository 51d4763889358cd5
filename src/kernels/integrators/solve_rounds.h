// One solve for bounds, kept couplings and contacts: what all its uses share. SPDX-License-Identifier: Apache-2.0
//
// (M107), (M117) to (M119). The position phase and the velocity phase are solved by the same rounds, where they differ.
#pragma once

#include "integrate.h"
#include "kernels/rounds/newton.h"
#include "kernels/rounds/sweeps.h"

namespace lockstep::kernels {

/// Calls visit(number) for all numbers that a solve produces, the coupling rows' impulses first.
template <class T, class Visit>
LOCKSTEP_INLINE void each_result(const Tables<ScalarOf<T>>& t, Tile<T>& x, Visit&& visit) {
  const auto all = [&](T* numbers, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) visit(numbers[i]);
  };
  const int rows = t.rows.count, solver = t.solver.n, twice = t.solve_twice ? 1 : 0;
  all(x.rows.position_impulse, rows);
  all(x.rows.velocity_impulse, twice * rows);
  all(x.rows.speed, rows);
  all(x.rows.velocity_phase_speed, twice * rows);
  all(x.dynamics.solution, solver);
  all(x.dynamics.velocity_solution, twice * solver);
  all(x.next.q, t.joints);
  all(x.next.v, t.velocities);
  all(x.next.pose, 7 * t.roots.count);
  all(x.half_turn, 4 * t.roots.count);
  all(x.diagnostics.moved_velocity, t.record_diagnostics ? t.velocities : 0);
}

/// No velocity meets a row that asks for NaN or infinity. Makes a velocity of such lanes NaN, which check() finds.
template <class T>
void mark_invalid(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  T& last = x.next.v[t.velocities - 1];
  last = select(x.bounds.invalid, T(ScalarOf<T>(__builtin_nan(""))), last);
}

/// What all solves of a step need: the matrix, and the intervals of both phases.
template <class T>
void begin_rounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  begin_servos(t, x);
  x.bounds.invalid = T::none();
  x.rounds.weak = T::none();
  open_intervals(t, batch, position_phase, x);
  if (t.solve_twice) open_intervals(t, batch, velocity_phase, x);
  if (t.rounds.needs_responses) exact_responses(t, x);
}

/// Exchanges the two phases' intervals and momenta: a solve takes those of the first.
template <class T>
void exchange_phases(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int rows = t.bounds.rows.count, n = t.rounds.columns.n;
  const auto exchange = [](T& a, T& b) LOCKSTEP_INLINED {
    const T kept = a;
    a = b, b = kept;
  };
  for (int r = 0; r < rows; ++r)
    exchange(x.bounds.lo[r], x.bounds.lo[rows + r]), exchange(x.bounds.hi[r], x.bounds.hi[rows + r]);
  for (int k = 0; k < n; ++k) exchange(x.held.momentum[k], x.held.momentum[n + k]);
}

/// Lanes in which a row over several velocities asks for something else in the velocity phase.
template <class T>
typename T::Mask rows_with_two_phases(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  auto differ = T::none();
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>&, const int*, const T*) LOCKSTEP_INLINED {
    if (slot.loop >= 0) return;
    if (slot.coupling >= 0) {
      const int e = slot.coupling;
      differ = differ | beyond(position_phase_bias(t, x, e) - velocity_phase_bias(t, x, e), T(0));
      return;
    }
    const int r = slot.bounded;
    differ = differ | beyond(x.bounds.lo[r] - x.bounds.lo[count + r], T(0)) |
             beyond(x.bounds.hi[r] - x.bounds.hi[count + r], T(0));
    if (t.bounds.kind[r] != BoundKind::joint)
      differ = differ | beyond(x.bounds.centre[r] - x.bounds.centre[count + r], T(0));
  });
  return t.loops.used() ? differ | loops_with_two_phases(t, x) : differ;
}

/// What is not finished may be beyond its interval.
template <class T>
void clamp_unfinished(const Tables<ScalarOf<T>>& t, typename T::Mask unfinished, Tile<T>& x) {
  for (int r = 0; r < t.bounds.single; ++r) {
    T& speed = x.rounds.z[t.rounds.velocity[r]];
    speed = select(unfinished, clamp(speed, x.bounds.lo[r], x.bounds.hi[r]), speed);
  }
}

/// Keeps the impulses of a solve in these lanes, as those of a phase.
template <class T>
void keep_impulses(const Tables<ScalarOf<T>>& t, Phase phase, typename T::Mask lanes, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  const auto keep = [&](T& kept, T now) LOCKSTEP_INLINED { kept = select(lanes, now, kept); };
  for (int r = 0; r < t.bounds.single; ++r) keep(x.bounds.impulse[phase * count + r], x.rounds.single_impulse[r]);
  each_row(t, x, [&](const RowSlot& slot, ActingRow<T>& row, const int*, const T*) LOCKSTEP_INLINED {
    if (slot.bounded >= 0) return keep(x.bounds.impulse[phase * count + slot.bounded], row.law.impulse);
    if (slot.loop >= 0) return keep(x.loops.impulse[phase * t.loops.rows + slot.loop], row.law.impulse);
    keep(phase == position_phase ? x.rows.position_impulse[slot.coupling] : x.rows.velocity_impulse[slot.coupling],
         row.law.impulse);
    keep(phase == position_phase ? x.rows.speed[slot.coupling] : x.rows.velocity_phase_speed[slot.coupling], row.speed);
  });
}

/// Lists the bounded rows that have an impulse in these lanes, beside those that are listed in others. Returns the
/// lanes in which some has.
template <class T>
typename T::Mask list_active_rows_of(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  auto some = T::none();
  for (int r = 0, listed = 0; r < count; ++r) {
    const bool is_listed = listed < x.bounds.active_count && x.bounds.active_rows[listed] == r;
    x.bounds.active[r] = is_listed ? x.bounds.active[r] & ~lanes : T::none();
    listed += is_listed;
  }
  x.bounds.active_count = 0;
  for (int r = 0; r < count; ++r) {
    auto active = r < t.bounds.single ? held(x.search.branch[r]) & lanes : T::none();  // also with no impulse
    for (int p = 0; p < phases<T>(t); ++p) {
      active = active | (beyond(x.bounds.impulse[p * count + r], T(0)) & lanes);
      x.bounds.invalid =
          x.bounds.invalid | (beyond(x.bounds.impulse[p * count + r], T(largest_number<ScalarOf<T>>)) & lanes);
    }
    some = some | active;
    if (t.loops.used() && r < t.bounds.single)
      x.loops.stays[r] = (held(x.search.branch[r]) & lanes) | (x.loops.stays[r] & ~lanes);
    x.bounds.active[r] = x.bounds.active[r] | active;
    if (any(x.bounds.active[r])) x.bounds.active_rows[x.bounds.active_count++] = r;
  }
  return some;
}

/// Contacts have been found when the step without them is solved, but their law is not known yet.
template <class T>
void set_contacts_aside(Tile<T>& x) {
  x.contacts.set_aside = x.contacts.near_count;
  x.contacts.near_count = x.contacts.listed_count = 0;
}
template <class T>
void bring_contacts_back(Tile<T>& x) {
  x.contacts.near_count = x.contacts.listed_count = x.contacts.set_aside;
}

/// Both solves with bounds and kept couplings and without contacts, in the lanes `open`. Their results are
/// x.dynamics.solution and x.dynamics.velocity_solution.
template <class T>
void solve_rows(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                Tile<T>& x) {
  const int n = t.rounds.columns.n;
  set_contacts_aside(x);
  const auto twice =
      t.solve_twice ? (rows_with_two_phases(t, x) | lanes_with_two_phases(t, batch, x)) & open : T::none();
  for (int k = 0; k < n; ++k) x.rounds.z[k] = x.held.start[k];
  const auto solve = [&](Phase phase, typename T::Mask lanes) {
    open_row_slots(t, batch, phase, x);
    x.servos.corrected = phase == position_phase;
    if (phase == velocity_phase) exchange_phases(t, x);
    begin_newton(t, batch, lanes, x);
    const int sweeps = t.iterations + (phase == velocity_phase ? t.velocity_iterations : 0);
    const auto unfinished =
        t.method == Method::pgs ? sweep(t, batch, sweeps, true, lanes, x) : newton(t, batch, lanes, 1, x);
    clamp_unfinished(t, unfinished, x);
    x.contacts.unfinished += select(unfinished, T(1), T(0));
    if (phase == velocity_phase) exchange_phases(t, x);
    keep_impulses(t, phase, lanes, x);
  };
  if (any(twice)) {
    solve(velocity_phase, twice);
    from_rounds(t, x.rounds.z, x.dynamics.velocity_solution);
    x.servos.decided = twice;
  }
  solve(position_phase, open);
  x.servos.decided = T::none();
  from_rounds(t, x.rounds.z, x.dynamics.solution);
  if (t.solve_twice) {
    keep_impulses(t, velocity_phase, open & ~twice, x);
    for (int z = 0; z < n; ++z)
      x.dynamics.velocity_solution[z] = select(twice, x.dynamics.velocity_solution[z], x.dynamics.solution[z]);
  }
  bring_contacts_back(x);
}

/// Solves a step of euler in the lanes `open`. Lanes in which no bound acts keep the result that they have, to the last
/// bit.
template <class T>
void solve_rounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask open,
                  Tile<T>& x) {
  const bool first = t.solves_first();  // nothing has been solved yet
  matrix_of_bodies(t, x);
  begin_rounds(t, batch, x);
  open = open & ~x.bounds.invalid;
  T* kept = x.rounds.unbounded_result;
  if (!first) each_result(t, x, [&](const T& number) { *kept++ = number; });
  solve_rows(t, batch, open, x);
  if (first) x.singular = x.rounds.weak & open;
  const auto acts = list_active_rows_of(t, open, x);
  integrate(t, x);
  const T* restored = x.rounds.unbounded_result;
  if (!first) each_result(t, x, [&](T& number) { number = select(acts, number, *restored++); });
  mark_invalid(t, x);
}

}  // namespace lockstep::kernels
