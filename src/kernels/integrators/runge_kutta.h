// The classical Runge-Kutta method of fourth order. SPDX-License-Identifier: Apache-2.0
//
// (M72) to (M74). Every coupling is hard and eliminated here, and no term is implicit.
#pragma once

#include "kernels/couplings/functions.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "solve.h"

namespace lockstep::kernels {

/// (M74) at a floating root's pose. Its quaternion in x.state.pose is a unit quaternion, the one in x.stages.pose is
/// not.
template <class T>
void root_rate(const Tables<ScalarOf<T>>& t, Tile<T>& x, int root) {
  const T* const v = x.state.v + t.roots[root].velocity;
  T* const rate = x.stages.pose_rate + 7 * root;
  const Vec3<T> w = {v[0], v[1], v[2]}, u = {v[3], v[4], v[5]};
  const Vec3<T> moved = multiply(rotation_of_quaternion(x.state.pose + 7 * root + 3), u);
  for (int k = 0; k < 3; ++k) rate[k] = moved[k];
  const T half = T(ScalarOf<T>(0.5)), *q = x.stages.pose + 7 * root + 3;
  rate[3] = -half * fma(q[1], w[0], fma(q[2], w[1], q[3] * w[2]));
  rate[4] = half * fma(q[0], w[0], fnma(q[3], w[1], q[2] * w[2]));
  rate[5] = half * fma(q[0], w[1], fnma(q[1], w[2], q[3] * w[0]));
  rate[6] = half * fma(q[0], w[2], fnma(q[2], w[0], q[1] * w[1]));
}

/// The poses of a stage: x.stages.begin.pose + time rate, normalised in x.state.pose.
template <class T>
void move_stage_poses(const Tables<ScalarOf<T>>& t, Tile<T>& x, T time) {
  for (int k = 0; k < 7 * t.roots.count; ++k)
    x.state.pose[k] = x.stages.pose[k] = fma(time, x.stages.pose_rate[k], x.stages.begin.pose[k]);
  for (int r = 0; r < t.roots.count; ++r) make_unit(x.stages.pose + 7 * r + 3, x.state.pose + 7 * r + 3);
}

/// (M72): the change that the forces at x.state.q, x.state.v would make in a whole step.
template <class T>
void slope(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time, T* change) {
  kinematics(t, x);
  if (t.shares_change()) changing_shares(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  bias_forces(t, batch, x);
  joint_inertias(t, batch, x);  // the armature alone
  joint_forces(t, batch, x, time);
  inertia_matrix(t, batch, x);
  factorise(t, batch, x);
  solve(t, x);
  expand_changes(t, x, x.dynamics.solution, change);
  for (int r = 0; r < t.roots.count; ++r) {
    const T* const v = x.state.v + t.roots[r].velocity;
    T* const linear = change + t.roots[r].velocity + 3;
    const Vec3<T> w = {v[0], v[1], v[2]}, u = {v[3], v[4], v[5]};
    const Vec3<T> turning = cross(w, u);
    for (int k = 0; k < 3; ++k) linear[k] = fnma(T(t.dt), turning[k], linear[k]);
  }
}

template <class T>
void runge_kutta_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  constexpr S share[4] = {S(0), S(0.5), S(0.5), S(1)}, weight[4] = {S(1.0 / 6), S(1.0 / 3), S(1.0 / 3), S(1.0 / 6)};
  constexpr int time[4] = {0, 1, 1, 2};
  const S h = t.dt;

  // All stages begin here. Couplings are corrected once, at the end.
  copy_state(t, x.state, x.stages.begin);
  clear_state(t, x.stages.total_change);
  for (int k = 0; k < 7 * t.roots.count; ++k) x.stages.pose[k] = x.state.pose[k];
  if (t.reduction.followers > 0) coupling_errors(t, x);
  x.corrects_positions = x.solves_twice = false;
  auto singular = T::none();
  for (int i = 0; i < 4; ++i) {
    // The state of the stage (M72).
    if (i > 0) {
      for (int j = 0; j < t.joints; ++j) x.state.q[j] = fma(T(h * share[i]), x.stages.rate[j], x.stages.begin.q[j]);
      for (int k = 0; k < t.velocities; ++k) x.state.v[k] = fma(T(share[i]), x.stages.change[k], x.stages.begin.v[k]);
      move_stage_poses(t, x, T(h * share[i]));
      if (t.functions.used()) place_curved(t, x, x.state.q, x.state.v);
    }

    // Its change, with its weight (M73).
    slope(t, batch, x, time[i], x.stages.change);
    singular = singular | x.singular;
    for (int j = 0; j < t.joints; ++j) x.stages.rate[j] = x.state.v[t.velocity_of(j)];
    for (int b = 0; b < t.balls.count; ++b) {
      const Vec3<T> rate = rate_of_ball(t.balls[b], x.state.q, x.state.v);
      for (int k = 0; k < 3; ++k) x.stages.rate[t.balls[b].joint + k] = rate[k];
    }
    for (int j = 0; j < t.joints; ++j)
      x.stages.total_change.q[j] = fma(T(h * weight[i]), x.stages.rate[j], x.stages.total_change.q[j]);
    for (int k = 0; k < t.velocities; ++k)
      x.stages.total_change.v[k] = fma(T(weight[i]), x.stages.change[k], x.stages.total_change.v[k]);
    for (int r = 0; r < t.roots.count; ++r) root_rate(t, x, r);
    for (int k = 0; k < 7 * t.roots.count; ++k)
      x.stages.total_change.pose[k] = fma(T(h * weight[i]), x.stages.pose_rate[k], x.stages.total_change.pose[k]);
  }

  // The correction of followers, and the whole step.
  x.singular = singular;
  for (int f = 0; f < t.reduction.followers; ++f) {
    T& change = x.stages.total_change.q[t.reduction.follower[f]];
    change = fma(T(h), correcting_velocity(t, x, f), change);
  }
  copy_state(t, x.stages.begin, x.state);
  add_total_change(t, x);
}

}  // namespace lockstep::kernels
