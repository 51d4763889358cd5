// Bias forces c(q, v): Newton-Euler without joint accelerations. SPDX-License-Identifier: Apache-2.0
//
// A floating root's velocity is stepped in inertial axes, so that its origin goes straight on without acceleration.
// In the links' own frames, with the angular acceleration tensor of Balafoutis and Patel (1991):
// (M5) to (M9). One pass outwards for motion, one inwards for forces.
#pragma once

#include "frame.h"
#include "link_wrenches.h"

namespace lockstep::kernels {

/// (M5) Omega = [alpha]x + [omega]x [omega]x: acceleration of a point p of the body is a + Omega p.
template <class T>
LOCKSTEP_INLINE Mat3<T> acceleration_tensor(const Vec3<T>& w, const Vec3<T>& alpha) {
  const T xx = w[0] * w[0], yy = w[1] * w[1], zz = w[2] * w[2];
  const T xy = w[0] * w[1], xz = w[0] * w[2], yz = w[1] * w[2];
  return {{-(yy + zz), xy - alpha[2], xz + alpha[1],   //
           xy + alpha[2], -(xx + zz), yz - alpha[0],   //
           xz - alpha[1], yz + alpha[0], -(xx + yy)}};
}

/// (M7) Force and moment about the origin that the motion of the mass takes: F = m a + Omega h,
/// N = h x a + the axial part of Omega Sigma.
template <class T>
LOCKSTEP_INLINE void inertial_forces(const PseudoInertia<T>& body, const Mat3<T>& tensor, const Vec3<T>& a,
                                     Vec3<T>& force, Vec3<T>& moment) {
  force = multiply_add(tensor, body.moment, {body.mass * a[0], body.mass * a[1], body.mass * a[2]});
  Vec3<T> axial;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    T sum = tensor(j, 0) * body.pair(0, i);
    sum = fnma(tensor(i, 0), body.pair(0, j), sum);
    for (int l = 1; l < 3; ++l) sum = fnma(tensor(i, l), body.pair(l, j), fma(tensor(j, l), body.pair(l, i), sum));
    axial[k] = sum;
  }
  moment = cross_add(body.moment, a, axial);
}

/// Gravity in the frame that the bodies hang in: the fixed root's, or a floating root's own.
template <class T>
LOCKSTEP_INLINE Vec3<T> gravity_at_root(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, const Tile<T>& x) {
  Vec3<T> g;
  for (int k = 0; k < 3; ++k) g[k] = field<T>(lanes, 6, t.gravity).at(k, k);
  if (t.floating) return multiply_transposed(rotation_of_quaternion(x.root_pose + 3), g);
  if (!declared<T>(t, 6)) return g;  // turned when compiling
  Mat3<T> rotation;
  for (int k = 0; k < 9; ++k) rotation.m[k] = T(t.root_rotation[k]);
  return multiply_transposed(rotation, g);
}

template <class T>
void bias_forces(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const Vec3<T> g = gravity_at_root(t, lanes, x);
  const Vec3<T> upwards = {-g[0], -g[1], -g[2]};

  // Outwards (M6): gravity is an acceleration of the root against it.
  for (int b = 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root) {
      const Vec3<T> w = {x.v[0], x.v[1], x.v[2]};
      x.angular[b] = w;
      x.alpha[b] = Vec3<T>::zero();
      x.tensor[b] = acceleration_tensor(w, x.alpha[b]);
      x.linear[b] = upwards;
    } else {
      with_joint(body, [&](auto joint) {
        using J = decltype(joint);
        const T s = x.sine[b], c = x.cosine[b], speed = x.v[velocity_of(t, b)] * T(body.sign);
        Vec3<T> w, alpha, a;
        if (body.parent < 0) {
          w = alpha = Vec3<T>::zero();
          a = to_body(joint, body, s, c, upwards);
          if constexpr (!J::prismatic) w[J::k] = speed;
        } else {
          const int p = body.parent;
          const Vec3<T> r = origin(joint, body, J::prismatic ? x.q[joint_of(t, b)] : T(0));
          w = to_body(joint, body, s, c, x.angular[p]);
          alpha = to_body(joint, body, s, c, x.alpha[p]);
          a = to_body(joint, body, s, c, multiply_add(x.tensor[p], r, x.linear[p]));
          if constexpr (J::prismatic) {  // Coriolis: 2 w x e v
            const T twice = speed + speed;
            a[J::i] = fma(w[J::j], twice, a[J::i]);
            a[J::j] = fnma(w[J::i], twice, a[J::j]);
          } else {  // w x e v
            alpha[J::i] = fma(w[J::j], speed, alpha[J::i]);
            alpha[J::j] = fnma(w[J::i], speed, alpha[J::j]);
            w[J::k] += speed;
          }
        }
        x.angular[b] = w;
        x.alpha[b] = alpha;
        x.tensor[b] = acceleration_tensor(w, alpha);
        x.linear[b] = a;
      });
    }
    inertial_forces(inertia_of(t, x, b), x.tensor[b], x.linear[b], x.force[b], x.moment[b]);
  }

  if (declared<T>(t, 7)) subtract_link_wrenches(t, lanes, x);

  // Inwards (M9): what a joint carries beyond its own axis goes to its parent.
  for (int b = t.bodies - 1; b >= 0; --b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    const Vec3<T> force = x.force[b], moment = x.moment[b];
    if (body.root) {
      for (int k = 0; k < 3; ++k) x.drive[k] = moment[k], x.drive[3 + k] = force[k];
      continue;
    }
    with_joint(body, [&](auto joint) {
      using J = decltype(joint);
      x.drive[velocity_of(t, b)] = (J::prismatic ? force[J::k] : moment[J::k]) * T(body.sign);
      if (body.parent < 0) return;
      const T s = x.sine[b], c = x.cosine[b];
      const Vec3<T> r = origin(joint, body, J::prismatic ? x.q[joint_of(t, b)] : T(0));
      const Vec3<T> passed = to_parent(joint, body, s, c, force);
      x.force[body.parent] = x.force[body.parent] + passed;
      x.moment[body.parent] = x.moment[body.parent] + cross_add(r, passed, to_parent(joint, body, s, c, moment));
    });
  }
}

}  // namespace lockstep::kernels
