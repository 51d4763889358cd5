// What competes with couplings: limits, friction, kinematic drives, force limits. SPDX-License-Identifier: Apache-2.0
//
// Section 12. The step has been solved without bounds; where the result violates some, these rows are solved with the
// couplings, by the method's own way, until nothing more is violated. StatePointers that violate nothing keep what they
// have.
#pragma once

#include "integrate.h"
#include "kernels/bounds/active_set.h"
#include "kernels/bounds/bounded_sweeps.h"
#include "kernels/couplings/solve_couplings.h"

namespace lockstep::kernels {

/// No bounded row takes part yet.
template <class T>
LOCKSTEP_INLINE void clear_bounds(Tile<T>& x) {
  x.bounds.active_count = 0;
}

/// Visits all numbers that the step has come to, the coupling rows' impulses first: visit(number).
template <class T, class Visit>
LOCKSTEP_INLINE void each_result(const Tables<ScalarOf<T>>& t, Tile<T>& x, Visit&& visit) {
  const auto all = [&](T* numbers, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) visit(numbers[i]);
  };
  const int rows = t.rows.count, solver = t.solver.n, closing = t.solve_twice ? 1 : 0;
  all(x.rows.position_impulse, rows);
  all(x.rows.velocity_impulse, closing * rows);
  all(x.rows.speed, rows);
  all(x.rows.velocity_phase_speed, closing * rows);
  all(x.dynamics.solution, solver);
  all(x.dynamics.velocity_solution, closing * solver);
  all(x.next.q, t.joints);
  all(x.next.v, t.velocities);
  all(x.next.pose, t.floating ? 7 : 0);
  all(x.half_turn, t.floating ? 4 : 0);
  all(x.diagnostics.moved_velocity, t.record_diagnostics ? t.velocities : 0);
}

/// Where no bound acts, all of it as it was: it was solved again for lanes that have none as well, and by other code
/// than before where the step is listed or generated.
template <class T>
void restore_unbounded(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  typename T::Mask active = T::none();
  for (int i = 0; i < x.bounds.active_count; ++i) active = active | x.bounds.active[x.bounds.active_rows[i]];
  const T* alone = x.bounds.unbounded_result;
  each_result(t, x, [&](T& number) { number = select(active, number, *alone++); });
}

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

/// StatePointers that come near a bound, joint by joint and without regard to what exactly is asked of them.
template <class T>
typename T::Mask candidates(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  typename T::Mask candidate = T::none();
  for (int i = 0; i < b.watched.count; ++i) {
    const Watched<ScalarOf<T>>& joint = b.watched[i];
    const T q = x.state.q[joint.joint], moved = x.next.q[joint.joint];
    const T coasted = fma(T(t.dt), x.next.v[t.velocity_of(joint.joint)], q);  // with the velocity that stays
    T least = smaller(moved, coasted), most = larger(moved, coasted);
    if (joint.bounces) {  // by the speed that it comes with (M57)
      const T arriving = fma(T(t.dt), x.state.v[t.velocity_of(joint.joint)], q);
      least = smaller(least, arriving), most = larger(most, arriving);
    }
    candidate = candidate | less(least, T(joint.lower)) | less(T(joint.upper), most);
    if (joint.way > 0) candidate = candidate | less(T(joint.way), larger(most - q, q - least));
  }
  return candidate;
}

/// A first look at where the step has come to: whether some lane has to look closer, and which. Idle bounds cost no
/// more than this.
template <class T>
bool bounds_active(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.bounds.candidate = t.bounds.always ? ~T::none() : candidates(t, x);
  return any(x.bounds.candidate) || t.record_diagnostics;  // what is recorded of rows comes from a closer look
}

/// Where a row's demand is no number, no velocity meets it: one that is none either is found by check().
template <class T>
void mark_invalid(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  T& last = x.next.v[t.velocities - 1];
  last = select(x.bounds.invalid, T(ScalarOf<T>(__builtin_nan(""))), last);
}

template <class T>
void solve_bounds(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const int count = t.bounds.rows.count;
  T* solution[2] = {x.dynamics.solution, x.dynamics.velocity_solution};
  open_bounds(t, batch, x);
  const int looked_at = t.velocity_iterations > 0 ? phases<T>(t) : 1;  // without, tgs leaves its last velocity alone
  const auto active = [&] {
    bool found = false;
    for (int p = 0; p < looked_at; ++p) found = activate(t, Phase(p), solution[p], x) || found;
    return found;
  };
  x.bounds.candidate = x.bounds.candidate & ~x.bounds.invalid;
  if (!active()) return mark_invalid(t, x);
  if (t.rows.known_suffice) solve_couplings(t, batch, x);  // bounds feel the couplings' responses
  T* alone = x.bounds.unbounded_result;
  each_result(t, x, [&](const T& number) { *alone++ = number; });
  for (int p = 0; p < phases<T>(t); ++p)
    for (int r = 0; r < count; ++r) x.bounds.unbounded_speed[p * count + r] = bound_speed(t, x, r, solution[p]);
  do {
    list_active_rows(t, x);
    solve_with_bounds(t, batch, x);
    solved_velocities(t, x);
    integrate(t, x);
    restore_unbounded(t, x);
  } while (active());
  mark_invalid(t, x);
}

}  // namespace lockstep::kernels
