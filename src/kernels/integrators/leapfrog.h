// The midpoint rule with an implicit (SDIRK3) linear part, named leapfrog here, and its extrapolation.
// SPDX-License-Identifier: Apache-2.0
//
// (M66) to (M71). A step takes one mass matrix and two bias forces, all at the midpoint. Damping, drives and soft
// couplings take the three stages of Alexander's (1977) diagonally implicit method, which share one factorisation.
#pragma once

#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "solve.h"

namespace lockstep::kernels {

/// Coefficients of (M69).
template <class S>
struct Alexander {
  static constexpr double g = alexander_gamma;
  static constexpr S gamma = S(g);
  static constexpr S weight[leapfrog_stages] = {S(-(6 * g * g - 16 * g + 1) / 4), S((6 * g * g - 20 * g + 5) / 4),
                                                S(g)};
  /// a_ik, k < i
  static constexpr S before[leapfrog_stages][2] = {{S(0), S(0)}, {S((1 - g) / 2), S(0)}, {weight[0], weight[1]}};
};

/// One stage of (M68), from x.stages.begin.q, x.stages.midpoint.v and the earlier stages.
template <class T>
void stage(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int i, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int n = t.velocities;
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.begin.q[j];
  for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.midpoint.v[k];
  for (int earlier = 0; earlier < i; ++earlier) {
    const T duration = T(t.step * A::before[i][earlier]), share = T(A::before[i][earlier] / A::gamma);
    for (int j = 0; j < t.joints; ++j)
      x.state.q[j] = fma(duration, x.stages.velocity[earlier * n + t.velocity_of(j)], x.state.q[j]);
    for (int k = 0; k < n; ++k) x.state.v[k] = fma(share, x.stages.change[earlier * n + k], x.state.v[k]);
  }
  const bool last = i == leapfrog_stages - 1;
  x.corrects_positions = last;
  x.solves_twice = last && t.solve_twice;
  if (t.rows.count > 0 || (last && t.couplings > 0)) coupling_errors(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  joint_forces(t, batch, x, time + i);
  solve(t, x);
  T *change = x.stages.change + i * n, *velocity = x.stages.velocity + i * n;
  expand_changes(t, x, x.dynamics.solution, change);
  for (int k = 0; k < n; ++k) velocity[k] = changed_by(x.state.v[k], change[k]);
  for (int f = 0; last && f < t.reduction.followers; ++f)
    velocity[t.velocity_of(t.reduction.follower[f])] += x.couplings.correction[f];
  if (x.solves_twice) expand_changes(t, x, x.dynamics.velocity_solution, change);
}

/// A step from x.stages.begin to x.next. x.stages.mean_velocity is the velocity that moved the positions, and
/// x.stages.gained_velocity is what the velocities gained, along the midpoint's axes. x.state is overwritten.
template <class T>
void leapfrog(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int n = t.velocities;
  const S half = t.step * S(0.5);
  for (int j = 0; j < t.joints; ++j)
    x.state.q[j] = x.stages.midpoint.q[j] = fma(T(half), x.stages.begin.v[t.velocity_of(j)], x.stages.begin.q[j]);
  for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.begin.v[k];
  move_roots(t, x, half, x.stages.begin.v, x.stages.begin.pose, x.state.pose);
  turn_root_twists(t, x, x.state.v);
  for (int k = 0; k < n; ++k) x.stages.midpoint.v[k] = x.state.v[k];

  kinematics(t, x);
  joint_inertias(t, batch, x);
  inertia_matrix(t, batch, x);
  factorise(t, batch, x);

  bias_forces(t, batch, x);
  stage(t, batch, x, 0, time);
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];  // (M67)
  for (int k = 0; k < n; ++k) x.state.v[k] = fma(T(S(0.5) / A::gamma), x.stages.change[k], x.stages.midpoint.v[k]);
  bias_forces(t, batch, x);
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
  for (int j = 0; j < t.joints; ++j)
    x.next.q[j] = fma(T(t.step), x.stages.mean_velocity[t.velocity_of(j)], x.stages.begin.q[j]);
  for (int r = 0; r < t.roots.count; ++r)
    for (int k = t.roots[r].velocity, last = k + 6; k < last; ++k)
      x.state.v[k] = fma(T(S(2)), x.stages.mean_velocity[k], -x.stages.midpoint.v[k]);
  move_roots(t, x, half, x.state.v, x.state.pose, x.next.pose);
  turn_root_twists(t, x, x.next.v);
}

template <class T>
void leapfrog_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  copy_state(t, x.state, x.stages.begin);
  leapfrog(t, batch, x, 0);
  copy_state(t, x.stages.begin, x.state);  // lanes that fail keep it
}

/// Adds `share` of the change that the last leapfrog made to x.stages.total_change. The axes of a floating root have
/// turned in the step, so its change is a difference of twists.
template <class T>
void add_change(const Tables<ScalarOf<T>>& t, Tile<T>& x, ScalarOf<T> step, ScalarOf<T> share) {
  const auto add = [&](int k, T gained) LOCKSTEP_INLINED {
    x.stages.total_change.v[k] = fma(T(share), gained, x.stages.total_change.v[k]);
  };
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
