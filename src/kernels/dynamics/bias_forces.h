// Bias forces c(q, v): Newton-Euler without joint accelerations. SPDX-License-Identifier: Apache-2.0
//
// (M5) to (M9), in the frames of the bodies, with the angular acceleration tensor of Balafoutis and Patel (1991). One
// pass outwards finds the motion, one pass inwards the forces. The velocity of a floating root is stepped along
// inertial axes, so its origin has no acceleration here.
#pragma once

#include "balls.h"
#include "curved_motion.h"
#include "frame.h"
#include "link_wrenches.h"
#include "orientation.h"
#include "own_weights.h"

namespace lockstep::kernels {

/// (M5) Omega = [alpha]x + [omega]x [omega]x: a point p of the body has the acceleration a + Omega p.
template <class T>
LOCKSTEP_INLINE Mat3<T> acceleration_tensor(const Vec3<T>& w, const Vec3<T>& alpha) {
  const T zero = T(0), xx = fnma(w[0], w[0], zero), yy = fnma(w[1], w[1], zero), zz = fnma(w[2], w[2], zero);
  const T xy = w[0] * w[1], xz = w[0] * w[2], yz = w[1] * w[2];
  return {{yy + zz, xy - alpha[2], xz + alpha[1]},
          {xy + alpha[2], xx + zz, yz - alpha[0]},
          {xz - alpha[1], yz + alpha[0], xx + yy}};
}

/// a + Omega r for the body's origin r.
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> move_origin(J, const Mat3<T>& tensor, const Vec3<T>& r, Vec3<T> a) {
  each_axis([&](int k) LOCKSTEP_INLINED {
    each_axis([&](int l) LOCKSTEP_INLINED {
      if (J::off(l)) a[k] = fma(tensor(k, l), r[l], a[k]);
    });
  });
  return a;
}

/// (M7) The force and the moment about the origin that the motion of the body requires: F = m a + Omega h,
/// N = h x a + the axial part of Omega Sigma.
template <class T>
LOCKSTEP_INLINE void inertial_forces(const PseudoInertia<T>& body, bool diagonal, const Mat3<T>& tensor,
                                     const Vec3<T>& a, Vec3<T>& force, Vec3<T>& moment) {
  force = multiply_add(tensor, body.moment, {body.mass * a[0], body.mass * a[1], body.mass * a[2]});
  Vec3<T> axial;
  each_axis([&](int k) LOCKSTEP_INLINED {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    T sum = fnma(tensor(i, j), body.second[j], tensor(j, i) * body.second[i]);
    if (!diagonal) {
      sum = fma(tensor(j, j) - tensor(i, i), body.second[3 + k], sum);
      sum = fnma(tensor(i, k), body.second[3 + i], fma(tensor(j, k), body.second[3 + j], sum));
    }
    axial[k] = sum;
  });
  moment = cross_add(body.moment, a, axial);
}

/// The same for a body on a joint. The parent has the mass that lies on the axis of a revolute joint (M10).
template <class J, class T>
LOCKSTEP_INLINE void inertial_forces(J, const PseudoInertia<T>& body, bool diagonal, const Mat3<T>& tensor,
                                     const Vec3<T>& a, Vec3<T>& force, Vec3<T>& moment) {
  if constexpr (J::prismatic || (J::ball && J::rotated)) {
    inertial_forces(body, diagonal, tensor, a, force, moment);
  } else {
    constexpr int i = J::i, j = J::j, k = J::k;
    const T hi = body.moment[i], hj = body.moment[j], ii = body.second[i], jj = body.second[j];
    each_axis([&](int l) LOCKSTEP_INLINED { force[l] = fma(tensor(l, i), hi, tensor(l, j) * hj); });
    T ni = tensor(k, j) * jj, nj = -(tensor(k, i) * ii), nk = fnma(tensor(i, j), jj, tensor(j, i) * ii);
    if (!diagonal) {
      const T ij = body.second[3 + k], jk = body.second[3 + i], ik = body.second[3 + j];
      ni = fma(tensor(k, k) - tensor(j, j), jk, fma(tensor(k, i), ij, fnma(tensor(j, i), ik, ni)));
      nj = fma(tensor(i, i) - tensor(k, k), ik, fnma(tensor(k, j), ij, fma(tensor(i, j), jk, nj)));
      nk = fma(tensor(j, j) - tensor(i, i), ij, fnma(tensor(i, k), jk, fma(tensor(j, k), ik, nk)));
    }
    moment[i] = fma(hj, a[k], ni);
    moment[j] = fnma(hi, a[k], nj);
    moment[k] = fma(hi, a[j], fnma(hj, a[i], nk));
  }
}

/// A tree's share of gravity, along the axes of its root.
template <class T>
LOCKSTEP_INLINE Vec3<T> gravity_at_root(const Tables<ScalarOf<T>>& t, const TreePlace<ScalarOf<T>>& tree,
                                        const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  Vec3<T> g;
  for (int k = 0; k < 3; ++k) g[k] = field<T>(batch, Parameter::gravity, tree.gravity).at(k, k);
  if (t.declares(Parameter::gravity) && tree.gravity_share != 1)
    for (int k = 0; k < 3; ++k) g[k] *= T(tree.gravity_share);
  if (tree.root >= 0) return multiply_transposed(rotation_of_quaternion(x.state.pose + 7 * tree.root + 3), g);
  if (!t.declares(Parameter::gravity)) return g;  // compile() has rotated it and taken the share
  return multiply_transposed(Mat3<T>::constant(tree.rotation), g);
}

/// A floating root's motion, and the force and moment that it requires.
template <class T>
LOCKSTEP_INLINE void move_root_body(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, const Vec3<T>& upwards) {
  const T* const v = x.state.v + t.body[b].velocity;
  const Vec3<T> w = {v[0], v[1], v[2]};
  x.bodies.angular[b] = w;
  x.bodies.alpha[b] = Vec3<T>::zero();
  const Mat3<T> tensor = acceleration_tensor(w, x.bodies.alpha[b]);
  x.bodies.linear[b] = upwards;
  inertial_forces(x.bodies.base_inertia[b], t.body[b].diagonal, tensor, upwards, x.bodies.force[b], x.bodies.moment[b]);
}

/// (M6) A body's motion from its parent's, and the force and moment that it requires.
template <class J, class T>
LOCKSTEP_INLINE void move_body(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b, const Vec3<T>& upwards) {
  const Body<ScalarOf<T>>& body = t.body[b];
  const Turn<T> turn = turn_of(joint, body, x, b);
  const T speed = x.state.v[body.velocity] * T(body.sign);
  Vec3<T> w, alpha, a;
  if (body.parent < 0) {
    w = alpha = Vec3<T>::zero();
    a = to_body(joint, body, turn, upwards);
    if constexpr (J::ball)
      w = spin_of_ball(body.velocity, x.state.v);
    else if constexpr (!J::prismatic)
      w[J::k] = speed;
  } else if constexpr (J::ball && !J::rotated) {  // the first part has all of the motion, (M175)
    w = x.bodies.angular[body.parent], alpha = x.bodies.alpha[body.parent], a = x.bodies.linear[body.parent];
  } else {
    const int p = body.parent;
    Vec3<T> r = origin(joint, body, J::prismatic ? x.state.q[body.joint] : T(0));
    w = to_body(joint, body, turn, x.bodies.angular[p]);
    alpha = to_body(joint, body, turn, x.bodies.alpha[p]);
    // The parent's tensor again: to compute its few entries here costs less than to load them.
    a = to_body(joint, body, turn,
                move_origin(joint, acceleration_tensor(x.bodies.angular[p], x.bodies.alpha[p]), r, x.bodies.linear[p]));
    if constexpr (J::prismatic) {  // Coriolis: 2 w x e v
      const T twice = speed + speed;
      a[J::i] = fma(w[J::j], twice, a[J::i]);
      a[J::j] = fnma(w[J::i], twice, a[J::j]);
    } else if constexpr (J::ball) {
      const Vec3<T> spin = spin_of_ball(body.velocity, x.state.v);
      alpha = cross_add(w, spin, alpha);
      w = w + spin;
    } else {  // w x e v
      alpha[J::i] = fma(w[J::j], speed, alpha[J::i]);
      alpha[J::j] = fnma(w[J::i], speed, alpha[J::j]);
      w[J::k] += speed;
    }
  }
  if (t.reduction.removes_by_force)
    if (const int f = t.reduction.follower_of[body.joint]; f >= 0)
      (J::prismatic ? a : alpha)[J::k] += x.couplings.acceleration[f] * T(body.sign);
  if (t.functions.used())
    if (const int f = t.reduction.follower_of[body.joint]; f >= 0)
      (J::prismatic ? a : alpha)[J::k] += x.functions.acceleration[f] * T(body.sign);
  Mat3<T> tensor = acceleration_tensor(w, alpha);
  if (!body.leaf) {
    x.bodies.angular[b] = w;
    x.bodies.alpha[b] = alpha;
    x.bodies.linear[b] = a;
  }
  inertial_forces(joint, x.bodies.base_inertia[b], body.diagonal, tensor, a, x.bodies.force[b], x.bodies.moment[b]);
}

/// (M9) The component along the axis is the joint's bias force. The whole force and moment go on to the parent.
template <class J, class T>
LOCKSTEP_INLINE void pass_force(J joint, const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  const Body<ScalarOf<T>>& body = t.body[b];
  Vec3<T> force = x.bodies.force[b], moment = x.bodies.moment[b];
  x.dynamics.bias[body.velocity] = (J::prismatic ? force[J::k] : moment[J::k]) * T(body.sign);
  if (body.parent < 0) return;
  const Turn<T> turn = turn_of(joint, body, x, b);
  Vec3<T> r = origin(joint, body, J::prismatic ? x.state.q[body.joint] : T(0));
  Vec3<T> passed = to_parent(joint, body, turn, force);
  Vec3<T>& parent_force = x.bodies.force[body.parent];
  Vec3<T>& parent_moment = x.bodies.moment[body.parent];
  parent_moment = parent_moment + cross_origin_add(joint, r, passed, to_parent(joint, body, turn, moment));
  parent_force = parent_force + passed;
}

template <class T>
void bias_forces(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.functions.used()) curved_accelerations(t, x);
  for (int i = 0; i < t.tree.count; ++i) {
    const TreePlace<ScalarOf<T>>& tree = t.tree[i];
    // Gravity acts like an acceleration of the root in the opposite direction.
    const Vec3<T> g = gravity_at_root(t, tree, batch, x);
    const Vec3<T> upwards = {-g[0], -g[1], -g[2]};
    int b = tree.first_body;
    if (tree.root >= 0) move_root_body(t, x, b++, upwards);
    for (const int last = tree.last_body; b < last; ++b)
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED { move_body(joint, t, x, b, upwards); });
  }

  if (t.has_orientations()) orientations(t, x, x.bodies.orientation);
  if (t.declares(Parameter::link_wrench)) subtract_link_wrenches(t, batch, x);
  if (t.own_weights.count > 0) subtract_own_weights(t, batch, x);

  for (int b = t.bodies - 1; b >= 0; --b) {
    if (!t.body[b].root) {
      with_joint(t.body[b], [&](auto joint) LOCKSTEP_INLINED { pass_force(joint, t, x, b); });
      continue;
    }
    T* const bias = x.dynamics.bias + t.body[b].velocity;
    for (int k = 0; k < 3; ++k) bias[k] = x.bodies.moment[b][k], bias[3 + k] = x.bodies.force[b][k];
  }
  if (t.functions.used()) add_curved_armatures(t, batch, x);
}

}  // namespace lockstep::kernels
