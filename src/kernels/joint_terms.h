// Damping, drives, armature and efforts: their forces, and what of them stands in the matrix. SPDX-License-Identifier: Apache-2.0
//
// (M13) to (M15): terms linear in the joints' positions and velocities are integrated
// implicitly, so A = M + diag(a + h (d + kd) + h^2 kp) and the step needs no iterations for them.
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// Turns the bias forces in x.drive into dt times all forces (M15), and M in x.matrix into A (M14). Keeps M + armature
/// where soft rows are stated by natural frequency and A holds more than that.
template <class T>
void joint_terms(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  using S = ScalarOf<T>;
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
  for (int i = 0; i < t.driven.count; ++i) {
    const int j = t.driven[i], row = t.joint_row[j];
    const S* gains = lanes.field[3];
    const T kp = gains ? T::load(gains + 2 * row * lanes.stride) : T(t.kp[j]);
    const T kd = gains ? T::load(gains + (2 * row + 1) * lanes.stride) : T(t.kd[j]);
    const T position = T::load(lanes.position_target + row * lanes.stride);
    const T velocity = T::load(lanes.velocity_target + row * lanes.stride);
    const T v = x.v[root + j];
    const T ahead = fma(h, v, x.q[j]) - position;  // kp acts on where the joint is going
    x.drive[root + j] = fnma(h * kp, ahead, fnma(h * kd, v - velocity, x.drive[root + j]));
    if (own_terms) x.matrix[t.matrix.offset[root + j]] += fma(h, kd, h_squared * kp);
  }
}

}  // namespace lockstep::kernels
