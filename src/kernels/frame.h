// Passing vectors between a body's frame and its parent's. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// The joint's axis and kind as types, so that a planar rotation is four multiplications.
template <int Axis, bool Prismatic>
struct JointType {
  static constexpr int k = Axis, i = (Axis + 1) % 3, j = (Axis + 2) % 3;
  static constexpr bool prismatic = Prismatic;
};

/// Calls act(JointType) for the body's joint.
template <class S, class Act>
LOCKSTEP_INLINE void with_joint(const Body<S>& body, Act&& act) {
  switch (body.axis + (body.prismatic ? 3 : 0)) {
    case 0: return act(JointType<0, false>{});
    case 1: return act(JointType<1, false>{});
    case 2: return act(JointType<2, false>{});
    case 3: return act(JointType<0, true>{});
    case 4: return act(JointType<1, true>{});
    default: return act(JointType<2, true>{});
  }
}

/// Parent coordinates to body coordinates: E p of (M3).
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> to_body(J, const Body<ScalarOf<T>>& body, T s, T c, Vec3<T> p) {
  if (body.rotated) {
    const ScalarOf<T>* r = body.rotation;
    const auto row = [&](int a) { return fma(T(r[3 * a]), p.x, fma(T(r[3 * a + 1]), p.y, T(r[3 * a + 2]) * p.z)); };
    p = {row(0), row(1), row(2)};
  }
  if constexpr (!J::prismatic) {
    const T pi = p[J::i], pj = p[J::j];
    p[J::i] = fma(c, pi, s * pj);
    p[J::j] = fnma(s, pi, c * pj);
  }
  return p;
}

/// Body coordinates to parent coordinates: E^T p.
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> to_parent(J, const Body<ScalarOf<T>>& body, T s, T c, Vec3<T> p) {
  if constexpr (!J::prismatic) {
    const T pi = p[J::i], pj = p[J::j];
    p[J::i] = fnma(s, pj, c * pi);
    p[J::j] = fma(s, pi, c * pj);
  }
  if (body.rotated) {
    const ScalarOf<T>* r = body.rotation;
    const auto row = [&](int a) { return fma(T(r[a]), p.x, fma(T(r[3 + a]), p.y, T(r[6 + a]) * p.z)); };
    p = {row(0), row(1), row(2)};
  }
  return p;
}

/// Origin of the body in its parent's frame: r of (M3).
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> origin(J, const Body<ScalarOf<T>>& body, T q) {
  Vec3<T> r = Vec3<T>::constant(body.offset);
  if constexpr (J::prismatic) {
    const T travel = q * T(body.sign);
    if (body.rotated)
      for (int a = 0; a < 3; ++a) r[a] = fma(T(body.rotation[3 * J::k + a]), travel, r[a]);
    else
      r[J::k] += travel;
  }
  return r;
}

/// The joint that carries body b; bodies and joints differ by a floating root.
template <class S>
LOCKSTEP_INLINE int joint_of(const Tables<S>& t, int body) {
  return body - (t.floating ? 1 : 0);
}

/// Its place among the generalised velocities.
template <class S>
LOCKSTEP_INLINE int velocity_of(const Tables<S>& t, int body) {
  return body + (t.floating ? 5 : 0);
}

/// Rotation of a floating root: its coordinates to the world's.
template <class T>
LOCKSTEP_INLINE Mat3<T> rotation_of_quaternion(const T* wxyz) {
  const T w = wxyz[0], x = wxyz[1], y = wxyz[2], z = wxyz[3], two = T(2), one = T(1);
  return {{one - two * fma(y, y, z * z), two * fnma(w, z, x * y), two * fma(w, y, x * z),
           two * fma(w, z, x * y), one - two * fma(x, x, z * z), two * fnma(w, x, y * z),
           two * fnma(w, y, x * z), two * fma(w, x, y * z), one - two * fma(x, x, y * y)}};
}

/// Mass distribution of body b: the table's, or this tile's own.
template <class T>
LOCKSTEP_INLINE PseudoInertia<T> inertia_of(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  if (declared<T>(t, 5)) return x.inertia[b];
  const Body<ScalarOf<T>>& body = t.body[b];
  PseudoInertia<T> inertia{T(body.mass), Vec3<T>::constant(body.moment), {}};
  for (int k = 0; k < 6; ++k) inertia.second[k] = T(body.second[k]);
  return inertia;
}

}  // namespace lockstep::kernels
