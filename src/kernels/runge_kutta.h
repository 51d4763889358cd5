// The classical Runge-Kutta method of fourth order. SPDX-License-Identifier: Apache-2.0
//
// (M72) to (M74). Every coupling is hard and eliminated here, and no term is implicit.
#pragma once

#include "begin.h"
#include "bias_forces.h"
#include "coupling_error.h"
#include "joint_terms.h"
#include "kinematics.h"
#include "solve.h"

namespace lockstep::kernels {

/// (M74) at the root's pose in x.root_pose, whose quaternion is unit, and in x.stage_pose, whose quaternion is not.
template <class T>
void root_rate(Tile<T>& x, T* rate) {
  const Vec3<T> w = {x.v[0], x.v[1], x.v[2]}, u = {x.v[3], x.v[4], x.v[5]};
  const Vec3<T> moved = multiply(rotation_of_quaternion(x.root_pose + 3), u);
  for (int k = 0; k < 3; ++k) rate[k] = moved[k];
  const T half = T(ScalarOf<T>(0.5)), *q = x.stage_pose + 3;
  rate[3] = -half * fma(q[1], w[0], fma(q[2], w[1], q[3] * w[2]));
  rate[4] = half * fma(q[0], w[0], fnma(q[3], w[1], q[2] * w[2]));
  rate[5] = half * fma(q[0], w[1], fnma(q[1], w[2], q[3] * w[0]));
  rate[6] = half * fma(q[0], w[2], fnma(q[2], w[0], q[1] * w[1]));
}

/// Moves x.root_pose to x.begin_pose + time rate.
template <class T>
void move_stage_pose(Tile<T>& x, T time, const T* rate) {
  for (int k = 0; k < 7; ++k) x.root_pose[k] = x.stage_pose[k] = fma(time, rate[k], x.begin_pose[k]);
  make_unit(x.stage_pose + 3, x.root_pose + 3);
}

/// (M72) The change of velocity at x.q, x.v, if these lasted for the whole step.
template <class T>
void slope(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x, int time, T* change) {
  kinematics(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  bias_forces(t, lanes, x);
  joint_inertias(t, lanes, x);  // the armature alone
  joint_forces(t, lanes, x, time);
  inertia_matrix(t, x);
  factorise(t, lanes, x);
  solve(t, x);
  expand_changes(t, x, x.solution, change);
  if (!t.floating) return;
  const Vec3<T> w = {x.v[0], x.v[1], x.v[2]}, u = {x.v[3], x.v[4], x.v[5]};
  const Vec3<T> turning = cross(w, u);
  for (int k = 0; k < 3; ++k) change[3 + k] = fnma(T(t.dt), turning[k], change[3 + k]);
}

template <class T>
void runge_kutta_step(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  using S = ScalarOf<T>;
  constexpr S share[4] = {S(0), S(0.5), S(0.5), S(1)}, weight[4] = {S(1.0 / 6), S(1.0 / 3), S(1.0 / 3), S(1.0 / 6)};
  constexpr int time[4] = {0, 1, 1, 2};
  const int root = t.velocities - t.joints;
  const S h = t.dt;
  keep_begin(t, x);
  for (int j = 0; j < t.joints; ++j) x.change_q[j] = T(0);
  for (int k = 0; k < t.velocities; ++k) x.change_v[k] = T(0);
  for (int k = 0; t.floating && k < 7; ++k) x.stage_pose[k] = x.root_pose[k], x.change_pose[k] = T(0);
  if (t.reduction.followers > 0) coupling_errors(t, x);
  x.corrects = x.solves_twice = false;
  auto singular = T::none();
  for (int i = 0; i < 4; ++i) {
    if (i > 0) {
      for (int j = 0; j < t.joints; ++j) x.q[j] = fma(T(h * share[i]), x.v[root + j], x.begin_q[j]);
      for (int k = 0; k < t.velocities; ++k) x.v[k] = fma(T(share[i]), x.stage_change[k], x.begin_v[k]);
      if (t.floating) move_stage_pose(x, T(h * share[i]), x.pose_rate);
    }
    slope(t, lanes, x, time[i], x.stage_change);
    singular = singular | x.singular;
    for (int j = 0; j < t.joints; ++j) x.change_q[j] = fma(T(h * weight[i]), x.v[root + j], x.change_q[j]);
    for (int k = 0; k < t.velocities; ++k) x.change_v[k] = fma(T(weight[i]), x.stage_change[k], x.change_v[k]);
    if (!t.floating) continue;
    root_rate(x, x.pose_rate);
    for (int k = 0; k < 7; ++k) x.change_pose[k] = fma(T(h * weight[i]), x.pose_rate[k], x.change_pose[k]);
  }
  x.singular = singular;
  for (int f = 0; f < t.reduction.followers; ++f) {
    T& change = x.change_q[t.reduction.follower[f]];
    change = fma(T(h), correcting_velocity(t, x, f), change);
  }
  return_to_begin(t, x);
  for (int j = 0; j < t.joints; ++j) x.next_q[j] = changed_by(x.q[j], x.change_q[j]);
  for (int k = 0; k < t.velocities; ++k) x.next_v[k] = changed_by(x.v[k], x.change_v[k]);
  for (int k = 0; t.floating && k < 7; ++k) x.next_root_pose[k] = changed_by(x.root_pose[k], x.change_pose[k]);
  if (t.floating) make_unit(x.next_root_pose + 3, x.next_root_pose + 3);
}

}  // namespace lockstep::kernels
