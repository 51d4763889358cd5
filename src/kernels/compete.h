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

/// The coupling rows' impulses and speeds again where no bound acts: sweeps were made for lanes that have none as well.
template <class T>
void keep_untouched(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const int rows = t.rows.count;
  typename T::Mask touched = T::none();
  for (int i = 0; i < x.bound_count; ++i) touched = touched | x.bound_touched[x.bound_listed[i]];
  for (int e = 0; e < rows; ++e) {
    x.position_impulse[e] = select(touched, x.position_impulse[e], x.row_alone[e]);
    x.row_speed[e] = select(touched, x.row_speed[e], x.row_alone[2 * rows + e]);
    if (!t.solve_twice) continue;
    x.velocity_impulse[e] = select(touched, x.velocity_impulse[e], x.row_alone[rows + e]);
    x.row_speed_closed[e] = select(touched, x.row_speed_closed[e], x.row_alone[3 * rows + e]);
  }
}

template <class T>
void solve_with_bounds(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  switch (t.method) {
    case method_pgs: pgs_with_bounds(t, x); return keep_untouched(t, x);
    case method_tgs: t.renewed ? tgs_with_bounds(t, lanes, x) : pgs_with_bounds(t, x); return keep_untouched(t, x);
    default:
      find_active_set(t, position_phase, x);
      yield_to_bounds(t, position_phase, x, x.position_impulse);
      if (!t.solve_twice) return;
      ease_drives(t, x);
      find_active_set(t, velocity_phase, x);
      yield_to_bounds(t, velocity_phase, x, x.velocity_impulse);
  }
}

/// A first look at where the step has come to, joint by joint and without regard to what exactly is asked of it: whether
/// some lane has to look closer, and which. Idle bounds cost no more than this.
template <class T>
bool bounds_act(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Bounds<ScalarOf<T>>& b = t.bounds;
  const int root = t.velocities - t.joints;
  if (b.always) {
    x.suspect = ~T::none();
    return true;
  }
  x.suspect = T::none();
  for (int i = 0; i < b.watched.count; ++i) {
    const Watched<ScalarOf<T>>& joint = b.watched[i];
    const T q = x.q[joint.joint], moved = x.next_q[joint.joint];
    const T coasted = fma(T(t.dt), x.next_v[root + joint.joint], q);  // with the velocity that stays
    T least = smaller(moved, coasted), most = larger(moved, coasted);
    if (joint.bounces) {  // by the speed that it comes with (M57)
      const T arriving = fma(T(t.dt), x.v[root + joint.joint], q);
      least = smaller(least, arriving), most = larger(most, arriving);
    }
    x.suspect = x.suspect | less(least, T(joint.lower)) | less(T(joint.upper), most);
    if (joint.way > 0) x.suspect = x.suspect | less(T(joint.way), larger(most - q, q - least));
  }
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
  const int rows = t.rows.count, count = t.bounds.form.count;
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
  for (int p = 0; p < phases<T>(t); ++p) {
    const T* alone = p == position_phase ? x.position_impulse : x.velocity_impulse;
    const T* speed = p == position_phase ? x.row_speed : x.row_speed_closed;
    for (int e = 0; e < rows; ++e) x.row_alone[p * rows + e] = alone[e], x.row_alone[(2 + p) * rows + e] = speed[e];
    for (int r = 0; r < count; ++r) x.bound_free[p * count + r] = bound_speed(t, x, r, solution[p]);
  }
  do {
    list_bounds(t, x);
    solve_with_bounds(t, lanes, x);
    solved_velocities(t, x);
  } while (touched());
  integrate(t, x);
  spoil_senseless(t, x);
}

}  // namespace lockstep::kernels
