// The midpoint rule with an implicit (SDIRK3) linear part, named leapfrog here, and its extrapolation.
// SPDX-License-Identifier: Apache-2.0
//
// (M66) to (M71). A step takes one mass matrix and two bias forces, all at the midpoint. Damping, drives and soft
// couplings take the three stages of Alexander's (1977) diagonally implicit method, which share one factorisation.
#pragma once

#include "close_loops.h"
#include "guard.h"
#include "kernels/contacts/wrenches.h"
#include "kernels/couplings/functions.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "kernels/tile/routines.h"
#include "leapfrog_bounds.h"
#include "leapfrog_efforts.h"
#include "midpoint.h"

namespace lockstep::kernels {

/// The bias forces at the predicted velocities. The guard and the midpoint need the prediction later.
template <class T>
void bias_of_stages(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const int n = t.velocities;
  for (int k = 0; t.rounds.at_midpoint && k < n; ++k) x.midpoint.change[k] = x.stages.change[k];
  if (t.guarded) keep_prediction(t, x);
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < n; ++k)
    x.state.v[k] = fma(T(S(0.5) / Alexander<S>::gamma), x.stages.change[k], x.stages.midpoint.v[k]);
  bias_forces(t, batch, x);
}

/// The stages (M68), and the mean and last velocity of these (M70).
template <class T>
void take_stages(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  using A = Alexander<ScalarOf<T>>;
  const int n = t.velocities;
  if (!all_bounded(t, x))
    for (int i = 0; i < leapfrog_stages; ++i) stage(t, batch, x, i, time);
  for (int k = 0; k < n; ++k) {
    T mean = T(0), change = T(0);
    for (int i = 0; i < leapfrog_stages; ++i) {
      mean = fma(T(A::weight[i]), x.stages.velocity[i * n + k], mean);
      change = fma(T(A::weight[i] / A::gamma), x.stages.change[i * n + k], change);
    }
    x.stages.mean_velocity[k] = mean;
    x.stages.gained_velocity[k] = change;
    x.next.v[k] = changed_by(x.stages.midpoint.v[k], change);
  }
}

/// Every lane takes what the midpoint makes.
template <class T>
void leave_out_stages(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int k = 0; k < t.velocities; ++k) {
    x.stages.change[k] = x.stages.gained_velocity[k] = T(0);
    x.stages.mean_velocity[k] = x.next.v[k] = x.stages.midpoint.v[k];
  }
  if (t.guarded) keep_prediction(t, x);
}

/// To the midpoint (M66). From here on velocities are along the axes that roots have there.
template <class T>
void move_to_midpoint(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const ScalarOf<T> half = t.step * ScalarOf<T>(0.5);
  const int n = t.velocities;
  for (int j = 0; j < t.joints; ++j)
    x.state.q[j] = x.stages.midpoint.q[j] = fma(T(half), x.stages.begin.v[t.velocity_of(j)], x.stages.begin.q[j]);
  for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.begin.v[k];
  if (t.balls.count > 0) {
    move_balls(t, half, x.stages.begin.v, x.stages.begin.q, x.state.q);
    for (int j = 0; j < t.joints; ++j) x.stages.midpoint.q[j] = x.state.q[j];
  }
  move_roots(t, x, half, x.stages.begin.v, x.stages.begin.pose, x.state.pose);
  turn_root_twists(t, x, x.state.v);
  if (t.functions.used()) {
    place_curved(t, x, x.state.q, x.state.v);
    for (int j = 0; j < t.joints; ++j) x.stages.midpoint.q[j] = x.state.q[j];
  }
  kinematics(t, x);
  if (t.shares_change()) changing_shares(t, x);
  for (int i = 0; i < t.spatial.tendons.count; ++i)
    x.stages.midpoint.q[t.spatial.tendons[i].joint] = x.state.q[t.spatial.tendons[i].joint];
  for (int k = 0; k < n; ++k) x.stages.midpoint.v[k] = x.state.v[k];
}

/// The one matrix of the step with its factors, and the prediction (M67) without bounds.
template <class T>
void predict(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  joint_inertias(t, batch, x);
  inertia_matrix(t, batch, x);
  factorise(t, batch, x);
  bias_forces(t, batch, x);
  for (int k = 0; t.rounds.at_midpoint && k < t.velocities; ++k) x.midpoint.first_bias[k] = x.dynamics.bias[k];
  if (!t.loops.used()) stage(t, batch, x, 0, time);
}

/// Positions, and roots along the second half of their way (M70).
template <class T>
void move_to_end(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const ScalarOf<T> half = t.step * ScalarOf<T>(0.5);
  for (int j = 0; j < t.joints; ++j)
    x.next.q[j] = fma(T(t.step), x.stages.mean_velocity[t.velocity_of(j)], x.stages.begin.q[j]);
  second_half_velocities(t, x);
  if (t.balls.count > 0) move_balls(t, half, x.state.v, x.stages.midpoint.q, x.next.q);
  move_roots(t, x, half, x.state.v, x.state.pose, x.next.pose);
  turn_root_twists(t, x, x.next.v);
}

/// A step from x.stages.begin to x.next. x.stages.mean_velocity is the velocity that moved the positions, and
/// x.stages.gained_velocity is what the velocities gained, along the midpoint's axes. x.state is overwritten.
template <class T>
void leapfrog(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  routine(t, x, Routine::midpoint, [&]() LOCKSTEP_INLINED { move_to_midpoint(t, x); });
  if (t.loops.used()) find_loops(t, batch, x);
  find_contacts_at_midpoint(t, x);
  routine(t, x, Routine::prediction, [&]() LOCKSTEP_INLINED { predict(t, batch, x, time); });

  // The stages. Loops are held at the midpoint, where nothing of the stages would stay.
  if (t.loops.used()) {
    leave_out_stages(t, x);
  } else {
    if (t.rounds.in_stages) bound_prediction(t, batch, x, time);
    routine(t, x, Routine::bias, [&]() LOCKSTEP_INLINED { bias_of_stages(t, batch, x); });
    const auto stages = [&]() LOCKSTEP_INLINED { take_stages(t, batch, x, time); };
    all_bounded(t, x) ? stages() : routine(t, x, Routine::stages, stages);
  }
  x.corrects_positions = true, x.solves_twice = t.solve_twice;  // code of the last stage does not say so
  share_momenta(t, x);

  // Bounds within the stages (section 19), contacts and bounds at the midpoint (section 28), the guard (section 20).
  if (t.rounds.in_stages) bound_stages(t, batch, x, time);
  step_from_midpoint(t, batch, x, time);
  if (t.guarded) judge(t, batch, x);
  if (t.loops.used()) close_loops(t, batch, x);
  routine(t, x, Routine::end, [&]() LOCKSTEP_INLINED { move_to_end(t, x); });
  if (t.rounds.in_stages) settle(t, batch, x);
  if (t.functions.used()) place_curved(t, x, x.next.q, x.next.v);
  remember_midpoint(t, x);
  if (t.record_efforts) leapfrog_efforts(t, batch, x, time);
}

template <class T>
void take_halves(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                 int depth, Tile<T>& x);

/// One of the halves, for the lanes of x.guard.halved. It may be too coarse again.
template <class T>
void take_half(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int depth, Tile<T>& x) {
  const Tables<ScalarOf<T>>& half = *t.half;
  const auto lanes = x.guard.halved;
  if (half.half) copy_contacts(t, x, x.guard.remembered[depth + 1]);
  leapfrog(half, batch, x, 0);
  const auto coarse = x.guard.coarse & lanes;
  if (t.record_efforts) add_efforts(t, keeping_lanes(half, x), ScalarOf<T>(0.5) / (1 << depth), x);
  if (t.sums_contacts()) add_contact_impulses(t, keeping_lanes(half, x), x);
  if (!half.half)
    x.too_fast = x.too_fast | (~less(x.guard.eta, T(t.too_fast_above)) & coarse);
  else if (any(coarse))
    take_halves(half, batch, coarse, depth + 1, x);
  copy_state(t, x.next, x.stages.begin);
}

/// Takes the step from x.stages.begin again in these lanes, by two steps of half the length. Lanes of x.too_fast are
/// too coarse even for the shortest.
template <class T>
void take_halves(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, typename T::Mask lanes,
                 int depth, Tile<T>& x) {
  const State<T>&begin = x.guard.begin[depth], &end = x.guard.end[depth];
  auto singular = x.singular;
  const SolveCounts<T> counts = x.counts;

  // Keeps the step that was made, and goes back to the contacts of its start.
  copy_state(t, x.stages.begin, begin);
  copy_state(t, x.next, end);
  copy_contacts(t, x, x.guard.found[depth]);
  restore_contacts(t, ~T::none(), x.guard.remembered[depth], x);

  for (int part = 0; part < 2; ++part) {
    x.guard.halved = lanes;
    subroutine(t, x, "half", [&] { take_half(t, batch, depth, x); });
    singular = singular | (x.singular & lanes);
  }

  // Other lanes keep the step that they had.
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (x.next.*part)[i] = select(lanes, (x.next.*part)[i], (end.*part)[i]);
  });
  restore_contacts(t, ~lanes, x.guard.found[depth], x);
  if (t.counts_solves()) x.counts.restore(~lanes, counts);
  copy_state(t, begin, x.stages.begin);
  x.singular = singular;
}

/// Takes the step in halves in lanes where it was too coarse.
template <class T>
LOCKSTEP_INLINE void step_again_if(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (!t.guarded) return;
  x.too_fast = T::none();
  if (any(x.guard.coarse)) take_halves(t, batch, x.guard.coarse, 0, x);
}

template <class T>
void leapfrog_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  copy_state(t, x.state, x.stages.begin);
  x.contacts.work = T(0);
  if (t.guarded) copy_contacts(t, x, x.guard.remembered[0]);
  x.guard.halved = ~T::none();
  if (t.loops.used()) clear_loop_forces(t, x);
  leapfrog(t, batch, x, 0);
  if (t.record_efforts) {
    for (int j = 0; j < t.joints; ++j) x.records.effort[j] = T(0);
    add_efforts(t, keeping_lanes(t, x), ScalarOf<T>(1), x);
  }
  if (t.sums_contacts()) {
    clear_contact_impulses(t, x);
    add_contact_impulses(t, keeping_lanes(t, x), x);
  }
  if (t.guarded || t.rounds.used()) step_again_if(t, batch, x);
  if (t.loops.used()) end_loop_forces(t, t.step, x);
  copy_state(t, x.stages.begin, x.state);  // lanes that fail keep it
}

/// Takes the halves where compiled code has made a step of this depth, and found it too coarse in the lanes of
/// x.bounds.candidate.
template <class T>
void halve_again(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int depth, Tile<T>& x) {
  copy_state(t, x.state, x.stages.kept);  // where the step of depth 0 began
  take_halves(depth == 0 ? t : *t.half, batch, x.bounds.candidate, depth, x);
  copy_state(t, x.stages.kept, x.state);
}

/// Takes the step again in lanes in which straight-line code found that bounds act.
template <class T>
void step_again(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const auto lanes = x.bounds.candidate, singular = x.singular, too_fast = x.too_fast;
  copy_state(t, x.next, x.stages.kept);
  leapfrog_step(t, batch, x);
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (x.next.*part)[i] = select(lanes, (x.next.*part)[i], (x.stages.kept.*part)[i]);
  });
  x.singular = (x.singular & lanes) | (singular & ~lanes);
  x.too_fast = (x.too_fast & lanes) | (too_fast & ~lanes);
}

/// Adds `share` of the change that the last leapfrog made to x.stages.total_change. The axes of a floating root have
/// turned in the step, so its change is a difference of twists.
template <class T>
void add_change(const Tables<ScalarOf<T>>& t, Tile<T>& x, ScalarOf<T> step, ScalarOf<T> share) {
  const auto add = [&](int k, T gained) LOCKSTEP_INLINED {
    x.stages.total_change.v[k] = fma(T(share), gained, x.stages.total_change.v[k]);
  };
  for (int i = 0; i < t.balls.count; ++i)  // what moved their numbers
    for (int k = 0; k < 3; ++k) {
      const int j = t.balls[i].joint + k;
      x.stages.mean_velocity[t.balls[i].velocity + k] = T(ScalarOf<T>(1) / step) * (x.next.q[j] - x.stages.begin.q[j]);
    }
  for (int j = 0; j < t.joints; ++j) {
    const int k = t.velocity_of(j);
    x.stages.total_change.q[j] = fma(T(share * step), x.stages.mean_velocity[k], x.stages.total_change.q[j]);
    add(k, x.stages.gained_velocity[k]);
  }
  for (int r = 0; r < t.roots.count; ++r)
    for (int k = t.roots[r].velocity, last = k + 6; k < last; ++k) add(k, x.next.v[k] - x.stages.begin.v[k]);
  for (int k = 0; k < 7 * t.roots.count; ++k)
    x.stages.total_change.pose[k] =
        fma(T(share), x.next.pose[k] - x.stages.begin.pose[k], x.stages.total_change.pose[k]);
}

/// (M71): one step, and two of half the length with the tables t.half.
template <class T>
void extrapolated_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const S minus_third = S(-1.0 / 3), four_thirds = S(4.0 / 3);
  copy_state(t, x.state, x.stages.begin);
  copy_state(t, x.state, x.stages.first);
  clear_state(t, x.stages.total_change);

  leapfrog(t, batch, x, 0);
  add_change(t, x, t.step, minus_third);
  auto singular = x.singular;
  for (int half = 1; half <= 2; ++half) {
    leapfrog(*t.half, batch, x, half * leapfrog_stages);
    add_change(t, x, t.half->step, four_thirds);
    singular = singular | x.singular;
    copy_state(t, x.next, x.stages.begin);
  }
  x.singular = singular;

  copy_state(t, x.stages.first, x.state);
  add_total_change(t, x);
}

}  // namespace lockstep::kernels
