// Damping, drives, armature and efforts: their forces, and what of them stands in the matrix. SPDX-License-Identifier: Apache-2.0
//
// (M13) to (M15): terms linear in the joints' positions and velocities are integrated
// implicitly, so A = M + diag(a + h (d + kd) + h^2 kp) and the step needs no iterations for them.
#pragma once

#include "frame.h"

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
struct Servo {
  T kp, kd, position, velocity;
  /// Force at the end of the step, if the joint then has the speed v: the servo's part of (M13).
  LOCKSTEP_INLINE T force(T h, T q, T v) const { return -fma(kp, fma(h, v, q) - position, kd * (v - velocity)); }
};

template <class T>
LOCKSTEP_INLINE Servo<T> servo(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int j) {
  const int row = t.joint_row[j];
  const ScalarOf<T>* gains = lanes.field[3];
  return {gains ? T::load(gains + 2 * row * lanes.stride) : T(t.kp[j]),
          gains ? T::load(gains + (2 * row + 1) * lanes.stride) : T(t.kd[j]),
          T::load(lanes.position_target + row * lanes.stride), T::load(lanes.velocity_target + row * lanes.stride)};
}

template <class T>
LOCKSTEP_INLINE T feed_forward(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int j) {
  return T::load(lanes.effort + t.joint_row[j] * lanes.stride);
}

/// Turns the bias forces in x.drive into dt times all forces (M15), and M in x.matrix into A (M14). Keeps M + armature
/// where soft rows are stated by natural frequency and A holds more than that.
template <class T>
void joint_terms(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const int root = t.velocities - t.joints;
  const T h = T(t.dt), h_squared = T(t.dt * t.dt);
  if (t.natural.count > 0) {
    for (int e = 0; e < t.matrix.entries; ++e) x.natural_matrix[e] = x.matrix[e];
    for (int j = 0; j < t.joints; ++j) x.natural_matrix[t.matrix.offset[root + j]] += T(t.armature[j]);
  }

  const bool own_terms = declared<T>(t, 3) || declared<T>(t, 4);
  const Field<T> damping = field<T>(lanes, 4, t.damping.data);
  for (int i = 0; i < root; ++i) x.drive[i] = -(h * x.drive[i]);
  for (int j = 0; j < t.joints; ++j) {
    const int row = t.joint_row[j];
    const T d = damping.at(j, row);
    const T effort = T::load(lanes.effort + row * lanes.stride);
    x.drive[root + j] = h * (fnma(d, x.v[root + j], effort) - x.drive[root + j]);
    x.matrix[t.matrix.offset[root + j]] += own_terms ? fma(h, d, T(t.armature[j])) : T(t.implicit[j]);
  }
  for (int i = 0; i < t.clamped.count; ++i) {  // (M57) without a servo
    const int j = t.clamped[i];
    const T effort = feed_forward<T>(t, lanes, j), most = T(t.effort_limit[j]);
    x.drive[root + j] = fma(h, clamp(effort, -most, most) - effort, x.drive[root + j]);
  }
  for (int i = 0; i < t.driven.count; ++i) {
    const int j = t.driven[i];
    const Servo<T> own = servo<T>(t, lanes, j);
    const T v = x.v[root + j];
    const T ahead = fma(h, v, x.q[j]) - own.position;  // kp acts on where the joint is going
    x.drive[root + j] = fnma(h * own.kp, ahead, fnma(h * own.kd, v - own.velocity, x.drive[root + j]));
    if (own_terms) x.matrix[t.matrix.offset[root + j]] += fma(h, own.kd, h_squared * own.kp);
  }
}

}  // namespace lockstep::kernels
