// What of joints' armature, damping and drives stands in the matrix (M14), and the matrix with it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "merged_columns.h"

namespace lockstep::kernels {

template <class T>
struct Gains {
  T kp, kd;
};

template <class T>
LOCKSTEP_INLINE Gains<T> gains(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, int j) {
  const ScalarOf<T>* own = lanes.field[3];
  if (!own) return {T(t.kp[j]), T(t.kd[j])};
  own += 2 * t.joint_row[j] * lanes.stride;
  return {T::load(own), T::load(own + lanes.stride)};
}

/// a + h (d + kd) + h^2 kp of each joint, but for servos that may come to the limit of their effort.
template <class T>
void joint_inertias(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  if (!declared<T>(t, 3) && !declared<T>(t, 4)) {
    for (int j = 0; j < t.joints; ++j) x.joint_inertia[j] = T(t.implicit[j]);
    return;
  }
  const T ahead = T(t.ahead), ahead_squared = T(t.ahead * t.ahead);
  const Field<T> damping = field<T>(lanes, 4, t.damping.data);
  for (int j = 0; j < t.joints; ++j) x.joint_inertia[j] = fma(ahead, damping.at(j, t.joint_row[j]), T(t.armature[j]));
  for (int i = 0; i < t.driven.count; ++i) {
    const int j = t.driven[i];
    const Gains<T> own = gains<T>(t, lanes, j);
    x.joint_inertia[j] += fma(ahead, own.kd, ahead_squared * own.kp);
  }
}

/// A, or A_r at once where columns are merged; neither where articulated bodies do without. Keeps M + armature where soft
/// rows are stated by natural frequency and A holds more than that; x.joint_inertia becomes the diagonal of A where a
/// limited drive will want it.
template <class T>
void inertia_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  if (t.reduction.merged.slots > 0) return merged_columns(t, x);
  if (t.articulated.used() && t.natural.count == 0) return;
  mass_matrix(t, x);
  const int root = t.velocities - t.joints;
  if (t.natural.count > 0) {
    for (int e = 0; e < t.matrix.entries; ++e) x.natural_matrix[e] = x.matrix[e];
    for (int j = 0; j < t.joints; ++j) x.natural_matrix[t.matrix.offset[root + j]] += T(t.armature[j]);
  }
  for (int j = 0; !t.articulated.used() && j < t.joints; ++j) {
    T& diagonal = x.matrix[t.matrix.offset[root + j]];
    diagonal += x.joint_inertia[j];
    if (t.limited.count > 0) x.joint_inertia[j] = diagonal;
  }
}

/// The force that joint inertia alone takes for what a follower loses of its mismatch.
template <class T>
LOCKSTEP_INLINE void lose_mismatch(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f, T inertia) {
  T& drive = x.drive[t.velocities - t.joints + t.reduction.follower[f]];
  drive = fma(inertia, x.lost[f], drive);
}

/// More inertia of joint j, when A or A_r has been made.
template <class T>
LOCKSTEP_INLINE void add_inertia(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int j, T inertia) {
  if (t.reduction.merged.slots > 0)
    add_squares(t, x, j + (t.floating ? 1 : 0), inertia);
  else
    x.matrix[t.matrix.offset[t.velocities - t.joints + j]] += inertia;
  if (t.reduction.by_force)
    if (const int f = t.reduction.follower_of[j]; f >= 0) lose_mismatch(t, x, f, inertia);
}

}  // namespace lockstep::kernels
