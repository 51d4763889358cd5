// The solve with bounds: limits, friction, kinematic drives, force limits. SPDX-License-Identifier: Apache-2.0
//
// Section 12. The step has been solved without bounds. Rows that its result violates are now solved together with the
// couplings, by the plan's method, until no further row is violated. Where the plan has rounds, velocities are held in
// the factor of A, and rows over several velocities are slots of the rounds. Lanes that violate none keep their result.
#pragma once

#include "integrate.h"
#include "kernels/bounds/active_set.h"
#include "kernels/bounds/bounded_sweeps.h"
#include "kernels/bounds/held_velocities.h"
#include "kernels/couplings/solve_couplings.h"
#include "solve_rounds.h"

namespace lockstep::kernels {

/// No bounded row is active yet.
template <class T>
LOCKSTEP_INLINE void clear_bounds(Tile<T>& x) {
  x.bounds.active_count = 0;
}

/// Lanes in which some row is active.
template <class T>
typename T::Mask lanes_with_active_rows(const Tile<T>& x) {
  typename T::Mask active = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i) active = active | x.bounds.active[x.bounds.active_rows[i]];
  return active;
}

/// Restores the unbounded result in lanes without an active bound. They have been solved again with the others, and by
/// other code where compiled or generated code made the step.
template <class T>
void restore_unbounded(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const auto active = lanes_with_active_rows(x);
  const T* unbounded = x.bounds.unbounded_result;
  each_result(t, x, [&](T& number) { number = select(active, number, *unbounded++); });
}

/// Solves couplings and active rows by the plan's method.
template <class T>
void solve_with_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  switch (t.method) {
    case Method::pgs: return pgs_with_bounds(t, x);
    case Method::tgs: return t.renewed ? tgs_with_bounds(t, batch, x) : pgs_with_bounds(t, x);
    default:
      find_active_set(t, position_phase, x);
      back_substitute_couplings(t, position_phase, x, x.rows.position_impulse);
      if (!t.solve_twice) return;
      relax_drives(t, x);
      find_active_set(t, velocity_phase, x);
      back_substitute_couplings(t, velocity_phase, x, x.rows.velocity_impulse);
  }
}

/// Lanes in which a joint comes near a limit. This tests only the watched joints, and not what exactly their rows ask.
template <class T>
typename T::Mask candidates(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  typename T::Mask candidate = T::none();
  for (int i = 0; i < b.watched.count; ++i) {
    const Watched& joint = b.watched[i];
    const T q = x.state.q[joint.joint], moved = x.next.q[joint.joint];
    const T coasted = fma(T(t.dt), x.next.v[t.velocity_of(joint.joint)], q);  // with the velocity of the velocity phase
    T least = smaller(moved, coasted), most = larger(moved, coasted);
    if (joint.bounces) {  // a bounce depends on the speed at the start (M57)
      const T arriving = fma(T(t.dt), x.state.v[t.velocity_of(joint.joint)], q);
      least = smaller(least, arriving), most = larger(most, arriving);
    }
    if (joint.ranged) {
      const Interval<T> range = position_limits<T>(t, batch, joint.joint);
      candidate = candidate | less(least, range.lo) | less(range.hi, most);
    }
    if (joint.has_way) {
      const T way = T(t.dt) * speed_limit<T>(t, batch, joint.joint);
      candidate = candidate | less(way, larger(most - q, q - least));
    }
  }
  return candidate;
}

/// First test after the solve: finds the candidate lanes, and returns whether solve_bounds() has to run. Inactive
/// bounds cost no more than this.
template <class T>
bool bounds_active(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.bounds.candidate = t.bounds.always ? ~T::none() : candidates(t, batch, x);
  return any(x.bounds.candidate) || t.record_diagnostics;  // diagnostics need the rows in any case
}

/// Lists the rows that hold a velocity or have an impulse, and their impulses.
template <class T>
void list_held_rows(const Tables<ScalarOf<T>>& t, typename T::Mask open, Tile<T>& x) {
  const int count = t.bounds.rows.count, n = t.rounds.columns.n;
  x.bounds.active_count = 0;
  for (int r = 0; r < count; ++r) {
    x.bounds.active[r] = T::none();
    for (int p = 0; p < phases<T>(t); ++p) {
      const Branch<T>& own = x.search.branch[p * count + r];
      const T impulse = select(held(own), x.held.impulse[p * n + t.rounds.velocity[r]], own.impulse);
      x.bounds.impulse[p * count + r] = impulse;
      x.bounds.active[r] = x.bounds.active[r] | ((held(own) | beyond(impulse, T(0))) & open);
      x.bounds.invalid = x.bounds.invalid | (beyond(impulse, largest<T>()) & open);
    }
    if (any(x.bounds.active[r])) x.bounds.active_rows[x.bounds.active_count++] = r;
  }
}

/// Solves with velocities held in the factor of A. Where servos are limited, this is the first solve of the step.
template <class T>
void solve_by_velocity(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const int count = t.bounds.rows.count, n = t.solver.n;
  const bool first = t.limited_servos.count > 0, twice = phases<T>(t) == 2;
  begin_servos(t, x);
  x.bounds.invalid = T::none();
  const auto singular = x.singular;
  const auto lanes = [&] { return x.bounds.candidate & ~x.bounds.invalid & ~x.frozen; };
  const auto search = [&](int phases) {
    for (int p = 0; p < phases; ++p) open_intervals(t, batch, Phase(p), x);
    x.search.open = lanes(), x.search.going_on = T::none();
    search_held_velocities(t, batch, phases, ~T::none(), x);
  };
  const auto search_once = [&] {  // both phases have the same solution
    search(1);
    for (int z = 0; twice && z < n; ++z) {
      x.held.velocity[n + z] = x.held.velocity[z];
      x.held.impulse[n + z] = x.held.impulse[z];
    }
    for (int r = 0; twice && r < count; ++r) {
      x.search.branch[count + r] = x.search.branch[r];
      x.bounds.lo[count + r] = x.bounds.lo[r], x.bounds.hi[count + r] = x.bounds.hi[r];
    }
  };
  if (twice)
    either_way(
        x, lanes_with_two_phases(t, batch, x), [&] { search(2); }, search_once);
  else
    search_once();
  const auto open = lanes();
  if (!first) x.singular = singular;
  list_held_rows(t, open, x);
  if (!first && x.bounds.active_count == 0) return mark_invalid(t, x);
  T* unbounded = x.bounds.unbounded_result;
  if (!first) each_result(t, x, [&](const T& number) { *unbounded++ = number; });
  for (int z = 0; z < n; ++z) x.dynamics.solution[z] = x.held.velocity[z];
  for (int z = 0; twice && z < n; ++z) x.dynamics.velocity_solution[z] = x.held.velocity[n + z];
  integrate(t, x);
  if (!first) restore_unbounded(t, x);
  mark_invalid(t, x);
  // A start that is too fast is a fault, although limits of velocity may hold it. Lanes without an active row do as
  // they would alone.
  T fastest = T(0);
  for (int z = 0; z < n; ++z) fastest = farther(fastest, x.dynamics.start[z]);
  T& last = x.next.v[t.velocities - 1];
  const auto lanes_to_check = first ? open : lanes_with_active_rows(x);
  last = select(beyond(fastest, T(t.velocity_bound)) & lanes_to_check, farther(largest<T>(), fastest), last);
}

/// Activates violated rows and solves with them, until no further row is violated.
template <class T>
void solve_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.rounds.used()) {
    if (t.method != Method::pgs && t.rounds.slots.count == 0 && t.rounds.from_bodies.count == 0)
      return solve_by_velocity(t, batch, x);
    return solve_rounds(t, batch, x.bounds.candidate & ~x.frozen, x);
  }
  const int count = t.bounds.rows.count;
  T* solution[2] = {x.dynamics.solution, x.dynamics.velocity_solution};
  open_bounds(t, batch, x);
  // Without velocity iterations tgs has nothing in its velocity phase that could meet a bound.
  const int checked_phases = t.velocity_iterations > 0 ? phases<T>(t) : 1;
  const auto activate_violated = [&] {
    bool found = false;
    for (int p = 0; p < checked_phases; ++p) found = activate(t, Phase(p), solution[p], x) || found;
    return found;
  };
  x.bounds.candidate = x.bounds.candidate & ~x.bounds.invalid;
  if (!activate_violated()) return mark_invalid(t, x);
  if (t.rows.known_suffice) solve_couplings(t, batch, x);  // bounded rows need the couplings' responses
  T* unbounded = x.bounds.unbounded_result;
  each_result(t, x, [&](const T& number) { *unbounded++ = number; });
  for (int p = 0; p < phases<T>(t); ++p)
    for (int r = 0; r < count; ++r) x.bounds.unbounded_speed[p * count + r] = bound_speed(t, x, r, solution[p]);
  do {
    list_active_rows(t, x);
    solve_with_bounds(t, batch, x);
    solved_velocities(t, x);
    integrate(t, x);
    restore_unbounded(t, x);
  } while (activate_violated());
  mark_invalid(t, x);
}

}  // namespace lockstep::kernels
