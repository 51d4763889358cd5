// What competes with couplings: limits, friction, kinematic drives, force limits. SPDX-License-Identifier: Apache-2.0
//
// Section 12. The step has been solved without bounds; where the result violates some, these rows are solved with the
// couplings, by the method's own way, until nothing more is violated. Lanes that violate nothing keep what they have.
#pragma once

#include "active_set.h"
#include "bounded_sweeps.h"
#include "couplings.h"
#include "integrate.h"

namespace lockstep::kernels {

/// No bounded row takes part yet.
template <class T>
LOCKSTEP_INLINE void forget_bounds(Tile<T>& x) {
  x.bound_count = 0;
}

/// Visits all numbers that the step has come to, the coupling rows' impulses first: visit(number).
template <class T, class Visit>
LOCKSTEP_INLINE void each_outcome(const Tables<ScalarOf<T>>& t, Tile<T>& x, Visit&& visit) {
  const auto all = [&](T* numbers, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) visit(numbers[i]);
  };
  const int rows = t.rows.count, solver = t.solver.n, closing = t.solve_twice ? 1 : 0;
  all(x.position_impulse, rows);
  all(x.velocity_impulse, closing * rows);
  all(x.row_speed, rows);
  all(x.row_speed_closed, closing * rows);
  all(x.solution, solver);
  all(x.closing_solution, closing * solver);
  all(x.next_q, t.joints);
  all(x.next_v, t.velocities);
  all(x.next_root_pose, t.floating ? 7 : 0);
  all(x.half_turn, t.floating ? 4 : 0);
  all(x.moved_velocity, t.record_diagnostics ? t.velocities : 0);
}

/// Where no bound acts, all of it as it was: it was solved again for lanes that have none as well, and by other code
/// than before where the step is listed or generated.
template <class T>
void keep_untouched(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  typename T::Mask touched = T::none();
  for (int i = 0; i < x.bound_count; ++i) touched = touched | x.bound_touched[x.bound_listed[i]];
  const T* alone = x.alone;
  each_outcome(t, x, [&](T& number) { number = select(touched, number, *alone++); });
}

template <class T>
void solve_with_bounds(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  switch (t.method) {
    case method_pgs: return pgs_with_bounds(t, x);
    case method_tgs: return t.renewed ? tgs_with_bounds(t, lanes, x) : pgs_with_bounds(t, x);
    default:
      find_active_set(t, position_phase, x);
      yield_to_bounds(t, position_phase, x, x.position_impulse);
      if (!t.solve_twice) return;
      ease_drives(t, x);
      find_active_set(t, velocity_phase, x);
      yield_to_bounds(t, velocity_phase, x, x.velocity_impulse);
  }
}

/// Lanes that come near a bound, joint by joint and without regard to what exactly is asked of them.
template <class T>
typename T::Mask suspects(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int root = t.velocities - t.joints;
  typename T::Mask suspect = T::none();
  for (int i = 0; i < b.watched.count; ++i) {
    const Watched<ScalarOf<T>>& joint = b.watched[i];
    const T q = x.q[joint.joint], moved = x.next_q[joint.joint];
    const T coasted = fma(T(t.dt), x.next_v[root + joint.joint], q);  // with the velocity that stays
    T least = smaller(moved, coasted), most = larger(moved, coasted);
    if (joint.bounces) {  // by the speed that it comes with (M57)
      const T arriving = fma(T(t.dt), x.v[root + joint.joint], q);
      least = smaller(least, arriving), most = larger(most, arriving);
    }
    suspect = suspect | less(least, T(joint.lower)) | less(T(joint.upper), most);
    if (joint.way > 0) suspect = suspect | less(T(joint.way), larger(most - q, q - least));
  }
  return suspect;
}

/// A first look at where the step has come to: whether some lane has to look closer, and which. Idle bounds cost no more
/// than this.
template <class T>
bool bounds_act(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.suspect = t.bounds.always ? ~T::none() : suspects(t, x);
  return any(x.suspect) || t.record_diagnostics;  // what is recorded of rows comes from a closer look
}

/// Where a row's demand is no number, no velocity meets it: one that is none either is found by check().
template <class T>
void spoil_senseless(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  T& last = x.next_v[t.velocities - 1];
  last = select(x.senseless, T(ScalarOf<T>(__builtin_nan(""))), last);
}

template <class T>
void compete(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const int count = t.bounds.form.count;
  T* solution[2] = {x.solution, x.closing_solution};
  open_bounds(t, lanes, x);
  const int looked_at = t.velocity_iterations > 0 ? phases<T>(t) : 1;  // without, tgs leaves its last velocity alone
  const auto touched = [&] {
    bool found = false;
    for (int p = 0; p < looked_at; ++p) found = touch(t, Phase(p), solution[p], x) || found;
    return found;
  };
  x.suspect = x.suspect & ~x.senseless;
  if (!touched()) return spoil_senseless(t, x);
  if (t.rows.prescribed) solve_couplings(t, lanes, x);  // bounds feel the couplings' responses
  T* alone = x.alone;
  each_outcome(t, x, [&](const T& number) { *alone++ = number; });
  for (int p = 0; p < phases<T>(t); ++p)
    for (int r = 0; r < count; ++r) x.bound_free[p * count + r] = bound_speed(t, x, r, solution[p]);
  do {
    list_bounds(t, x);
    solve_with_bounds(t, lanes, x);
    solved_velocities(t, x);
    integrate(t, x);
    keep_untouched(t, x);
  } while (touched());
  spoil_senseless(t, x);
}

}  // namespace lockstep::kernels
