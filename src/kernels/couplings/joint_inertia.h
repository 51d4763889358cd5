// What armatures, damping and drives add to the matrix (M14), and the matrix with it.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "composite_columns.h"

namespace lockstep::kernels {

template <class T>
struct Gains {
  T kp, kd;
};

template <class T>
LOCKSTEP_INLINE Gains<T> gains(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  const ScalarOf<T>* own = batch.field(Parameter::drive_gains);
  if (!own) return {T(t.kp[j]), T(t.kd[j])};
  own += 2 * t.dof[j] * batch.stride;
  return {T::load(own), T::load(own + batch.stride)};
}

template <class T>
LOCKSTEP_INLINE T armature(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  return field<T>(batch, Parameter::armature, t.armature.data).at(j, t.dof[j]);
}

/// Of the joint's spring.
template <class T>
LOCKSTEP_INLINE T stiffness(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int j) {
  return field<T>(batch, Parameter::stiffness, t.stiffness.data).at(j, t.dof[j]);
}

/// a + h (d + kd) + h^2 (kp + k) of each joint. Servos with an effort limit are not among them.
template <class T>
void joint_inertias(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (!t.declares(Parameter::drive_gains) && !t.declares(Parameter::damping) && !t.declares(Parameter::armature) &&
      !t.declares(Parameter::stiffness)) {
    for (int j = 0; j < t.joints; ++j) x.dynamics.joint_inertia[j] = T(t.implicit[j]);
    return;
  }
  const T ahead = T(t.ahead), ahead_squared = T(t.ahead * t.ahead);
  const Field<T> damping = field<T>(batch, Parameter::damping, t.damping.data);
  for (int j = 0; j < t.joints; ++j)
    x.dynamics.joint_inertia[j] = fma(ahead, damping.at(j, t.dof[j]), armature<T>(t, batch, j));
  for (int i = 0; i < t.servos.count; ++i) {
    const int j = t.servos[i];
    const Gains<T> own = gains<T>(t, batch, j);
    x.dynamics.joint_inertia[j] += fma(ahead, own.kd, ahead_squared * own.kp);
  }
  for (int i = 0; i < t.springs.count; ++i) {
    const int j = t.springs[i];
    x.dynamics.joint_inertia[j] = fma(ahead_squared, stiffness<T>(t, batch, j), x.dynamics.joint_inertia[j]);
  }
}

/// M + armature of trees with undamped rows.
template <class T>
LOCKSTEP_INLINE void keep_undamped(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int r = 0; r < t.undamped_velocities.count; ++r) {
    const SupportRun run = t.undamped_velocities[r];
    const int last = t.matrix.offset[run.last - 1] + t.matrix.size[run.last - 1];
    for (int e = t.matrix.offset[run.first]; e < last; ++e) x.undamped.matrix[e] = x.dynamics.matrix[e];
  }
  for (int j = 0; j < t.joints; ++j)
    if (t.tree_of_joint(j).has_undamped_rows)
      x.undamped.matrix[t.matrix.offset[t.velocity_of(j)]] += armature<T>(t, batch, j);
}

/// A, or A_r at once with composite columns, or neither with articulated bodies, tree by tree. Keeps M + armature if
/// softness by frequency needs it and A has more than that. x.dynamics.joint_inertia becomes the diagonal of A if the
/// guess about a limited servo needs it.
template <class T>
void inertia_matrix(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.reduction.composite.places > 0) clear_reduced(t, x);
  for (int i = t.tree.count - 1; i >= 0; --i) {
    const TreeStructure& tree = t.tree[i];
    if (tree.inertia == InertiaKind::composite_columns)
      composite_columns(t, tree, x);
    else if (tree.inertia == InertiaKind::matrix || tree.has_undamped_rows)
      mass_matrix(t, tree, x);
  }
  if (t.undamped.count > 0) keep_undamped(t, batch, x);
  for (int i = 0; i < t.tree.count; ++i) {
    const TreeStructure& tree = t.tree[i];
    if (tree.inertia != InertiaKind::matrix) continue;
    for (int j = tree.first_joint; j < tree.last_joint; ++j) {
      T& diagonal = x.dynamics.matrix[t.matrix.offset[t.velocity_of(j)]];
      diagonal += x.dynamics.joint_inertia[j];
      if (t.guesses_servos()) x.dynamics.joint_inertia[j] = diagonal;
    }
  }
}

/// Adds the part of A - M in the force that removes a follower's velocity error.
template <class T>
LOCKSTEP_INLINE void remove_velocity_error(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f, T inertia) {
  T& rhs = x.dynamics.rhs[t.velocity_of(t.reduction.follower[f])];
  rhs = fma(inertia, x.couplings.removed_this_step[f], rhs);
}

/// Adds inertia to joint j in A or A_r, after inertia_matrix().
template <class T>
LOCKSTEP_INLINE void add_inertia(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int j, T inertia) {
  if (t.tree_of_joint(j).inertia == InertiaKind::composite_columns)
    add_squares(t, x, t.joint_body[j], inertia);
  else
    x.dynamics.matrix[t.matrix.offset[t.velocity_of(j)]] += inertia;
  if (t.reduction.removes_by_force)
    if (const int f = t.reduction.follower_of[j]; f >= 0) remove_velocity_error(t, x, f, inertia);
}

}  // namespace lockstep::kernels
