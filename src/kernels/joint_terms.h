// Damping, drives, armature and efforts: their forces, and what of them stands in the matrix. SPDX-License-Identifier: Apache-2.0
//
// (M13) to (M15): terms linear in the joints' positions and velocities are integrated
// implicitly, so A = M + diag(a + h (d + kd) + h^2 kp) and the step needs no iterations for them.
#pragma once

#include "joint_inertia.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE T smaller(T a, T b) {
  return select(less(b, a), b, a);
}
template <class T>
LOCKSTEP_INLINE T larger(T a, T b) {
  return select(less(a, b), b, a);
}
template <class T>
LOCKSTEP_INLINE T clamp(T a, T lo, T hi) {
  return smaller(larger(a, lo), hi);
}

/// A joint's gains and where its servo pulls it, without and with the speed it has.
template <class T>
struct Servo : Gains<T> {
  using Gains<T>::kp, Gains<T>::kd;
  T position, velocity;
  /// Force at the end of the step, if the joint then has the speed v: the servo's part of (M13).
  LOCKSTEP_INLINE T force(T h, T q, T v) const { return -fma(kp, fma(h, v, q) - position, kd * (v - velocity)); }
};

/// Row of the joint's target or effort at one of the step's times. What is held has one row for all of them.
template <class S>
LOCKSTEP_INLINE std::ptrdiff_t input_row(const Tables<S>& t, int j, int time) {
  return t.joint_row[j] + (t.input_times > 1 ? time * t.joints : 0);
}

template <class T>
LOCKSTEP_INLINE Servo<T> servo(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int j, int time = 0) {
  const std::ptrdiff_t input = input_row(t, j, time) * lanes.stride;
  return {gains<T>(t, lanes, j), T::load(lanes.position_target + input), T::load(lanes.velocity_target + input)};
}

template <class T>
LOCKSTEP_INLINE T feed_forward(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int j, int time = 0) {
  return T::load(lanes.effort + input_row(t, j, time) * lanes.stride);
}

/// The bias forces become dt times all forces (M15), with what acts at this of the step's times. After joint_inertias(),
/// before inertia_matrix(), which may write over what that left.
template <class T>
void joint_forces(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x, int time = 0) {
  const int root = t.velocities - t.joints;
  const T h = T(t.dt), ahead = T(t.ahead);
  const Field<T> damping = field<T>(lanes, 4, t.damping.data);
  for (int i = 0; i < root; ++i) x.drive[i] = -(h * x.bias[i]);
  const int *limited = t.clamped.data, *const end = limited + t.clamped.count;
  for (int j = 0; j < t.joints; ++j) {
    const T d = damping.at(j, t.joint_row[j]);
    T effort = feed_forward<T>(t, lanes, j, time);
    if (limited != end && *limited == j) {  // (M63) without a servo
      const T most = T(t.effort_limit[j]);
      effort = clamp(effort, -most, most);
      ++limited;
    }
    x.drive[root + j] = h * (fnma(d, x.v[root + j], effort) - x.bias[root + j]);
  }
  for (int i = 0; i < t.driven.count; ++i) {
    const int j = t.driven[i];
    const Servo<T> own = servo<T>(t, lanes, j, time);
    const T v = x.v[root + j];
    const T reached = fma(ahead, v, x.q[j]) - own.position;  // kp acts on where the joint is going
    x.drive[root + j] = fnma(h * own.kp, reached, fnma(h * own.kd, v - own.velocity, x.drive[root + j]));
  }
  if (t.reduction.by_force)
    for (int f = 0; f < t.reduction.followers; ++f) lose_mismatch(t, x, f, x.joint_inertia[t.reduction.follower[f]]);
}

}  // namespace lockstep::kernels
