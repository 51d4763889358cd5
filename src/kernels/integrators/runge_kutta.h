// The classical Runge-Kutta method of fourth order. SPDX-License-Identifier: Apache-2.0
//
// (M72) to (M74). Every coupling is hard and eliminated here, and no term is implicit.
#pragma once

#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "solve.h"

namespace lockstep::kernels {

/// (M74) at the root's pose. The quaternion in x.state.pose is a unit quaternion, the one in x.stages.pose is not.
template <class T>
void root_rate(Tile<T>& x, T* rate) {
  const Vec3<T> w = {x.state.v[0], x.state.v[1], x.state.v[2]}, u = {x.state.v[3], x.state.v[4], x.state.v[5]};
  const Vec3<T> moved = multiply(rotation_of_quaternion(x.state.pose + 3), u);
  for (int k = 0; k < 3; ++k) rate[k] = moved[k];
  const T half = T(ScalarOf<T>(0.5)), *q = x.stages.pose + 3;
  rate[3] = -half * fma(q[1], w[0], fma(q[2], w[1], q[3] * w[2]));
  rate[4] = half * fma(q[0], w[0], fnma(q[3], w[1], q[2] * w[2]));
  rate[5] = half * fma(q[0], w[1], fnma(q[1], w[2], q[3] * w[0]));
  rate[6] = half * fma(q[0], w[2], fnma(q[2], w[0], q[1] * w[1]));
}

/// The pose of a stage: x.stages.begin.pose + time rate, normalised in x.state.pose.
template <class T>
void move_stage_pose(Tile<T>& x, T time, const T* rate) {
  for (int k = 0; k < 7; ++k) x.state.pose[k] = x.stages.pose[k] = fma(time, rate[k], x.stages.begin.pose[k]);
  make_unit(x.stages.pose + 3, x.state.pose + 3);
}

/// (M72): the change that the forces at x.state.q, x.state.v would make in a whole step.
template <class T>
void slope(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int time, T* change) {
  kinematics(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  bias_forces(t, batch, x);
  joint_inertias(t, batch, x);  // the armature alone
  joint_forces(t, batch, x, time);
  inertia_matrix(t, x);
  factorise(t, batch, x);
  solve(t, x);
  expand_changes(t, x, x.dynamics.solution, change);
  if (!t.floating) return;
  const Vec3<T> w = {x.state.v[0], x.state.v[1], x.state.v[2]}, u = {x.state.v[3], x.state.v[4], x.state.v[5]};
  const Vec3<T> turning = cross(w, u);
  for (int k = 0; k < 3; ++k) change[3 + k] = fnma(T(t.dt), turning[k], change[3 + k]);
}

template <class T>
void runge_kutta_step(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  constexpr S share[4] = {S(0), S(0.5), S(0.5), S(1)}, weight[4] = {S(1.0 / 6), S(1.0 / 3), S(1.0 / 3), S(1.0 / 6)};
  constexpr int time[4] = {0, 1, 1, 2};
  const S h = t.dt;
  copy_state(t, x.state, x.stages.begin);
  clear_state(t, x.stages.total_change);
  for (int k = 0; t.floating && k < 7; ++k) x.stages.pose[k] = x.state.pose[k];
  if (t.reduction.followers > 0) coupling_errors(t, x);
  x.corrects_positions = x.solves_twice = false;
  auto singular = T::none();
  for (int i = 0; i < 4; ++i) {
    if (i > 0) {
      for (int j = 0; j < t.joints; ++j)
        x.state.q[j] = fma(T(h * share[i]), x.state.v[t.velocity_of(j)], x.stages.begin.q[j]);
      for (int k = 0; k < t.velocities; ++k) x.state.v[k] = fma(T(share[i]), x.stages.change[k], x.stages.begin.v[k]);
      if (t.floating) move_stage_pose(x, T(h * share[i]), x.stages.pose_rate);
    }
    slope(t, batch, x, time[i], x.stages.change);
    singular = singular | x.singular;
    for (int j = 0; j < t.joints; ++j)
      x.stages.total_change.q[j] = fma(T(h * weight[i]), x.state.v[t.velocity_of(j)], x.stages.total_change.q[j]);
    for (int k = 0; k < t.velocities; ++k)
      x.stages.total_change.v[k] = fma(T(weight[i]), x.stages.change[k], x.stages.total_change.v[k]);
    if (!t.floating) continue;
    root_rate(x, x.stages.pose_rate);
    for (int k = 0; k < 7; ++k)
      x.stages.total_change.pose[k] = fma(T(h * weight[i]), x.stages.pose_rate[k], x.stages.total_change.pose[k]);
  }
  x.singular = singular;
  for (int f = 0; f < t.reduction.followers; ++f) {
    T& change = x.stages.total_change.q[t.reduction.follower[f]];
    change = fma(T(h), correcting_velocity(t, x, f), change);
  }
  copy_state(t, x.stages.begin, x.state);
  add_total_change(t, x);
}

}  // namespace lockstep::kernels
