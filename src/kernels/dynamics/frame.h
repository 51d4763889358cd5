// Transforms vectors between a body's frame and its parent's. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// The kind of a joint and of its body's offset, as a type: a rotation about an axis then takes four multiplications,
/// and an offset along one axis one.
template <int Axis, bool Prismatic, bool Rotated, bool First = true, bool Second = true>
struct JointType {
  static constexpr int k = Axis, i = (Axis + 1) % 3, j = (Axis + 2) % 3;
  static constexpr bool prismatic = Prismatic, rotated = Rotated, ball = false;
  /// Whether component a of the origin in the parent's frame may be nonzero.
  static constexpr bool off(int a) { return Prismatic || Rotated || (a == i && First) || (a == j && Second); }
};

/// A part of a ball joint: its first body makes all of the turn.
template <int Axis>
struct BallPart {
  static constexpr int k = Axis, i = (Axis + 1) % 3, j = (Axis + 2) % 3;
  static constexpr bool prismatic = false, rotated = Axis == 0, ball = true;
  static constexpr bool off(int) { return rotated; }
};

/// Calls act(JointType) for the body's joint. On the main path `act` is inlined, to stay in registers.
template <class S, class Act>
LOCKSTEP_INLINE void with_joint(const Body<S>& body, Act&& act) {
  switch (body.kind) {
    case 0 + next_axis: return act(JointType<0, false, false, true, false>{});
    case 0 + last_axis: return act(JointType<0, false, false, false, true>{});
    case 0 + both_axes: return act(JointType<0, false, false>{});
    case 3 + next_axis: return act(JointType<1, false, false, true, false>{});
    case 3 + last_axis: return act(JointType<1, false, false, false, true>{});
    case 3 + both_axes: return act(JointType<1, false, false>{});
    case 6 + next_axis: return act(JointType<2, false, false, true, false>{});
    case 6 + last_axis: return act(JointType<2, false, false, false, true>{});
    case 6 + both_axes: return act(JointType<2, false, false>{});
    case turned_joint: return act(JointType<2, false, true>{});
    case sliding_joint + 0: return act(JointType<0, true, false>{});
    case sliding_joint + 1: return act(JointType<1, true, false>{});
    case sliding_joint + 2: return act(JointType<2, true, false>{});
    case ball_joint + 0: return act(BallPart<0>{});
    case ball_joint + 1: return act(BallPart<1>{});
    case ball_joint + 2: return act(BallPart<2>{});
    default: return act(JointType<2, true, true>{});
  }
}

/// How a body is turned in its parent's frame.
template <class T>
struct Turn {
  T s, c;               // of the joint's angle
  const Mat3<T>* ball;  // body to parent coordinates, of a ball
};

template <class J, class T>
LOCKSTEP_INLINE Turn<T> turn_of(J, const Body<ScalarOf<T>>& body, const Tile<T>& x, int b) {
  if constexpr (J::ball)
    return {T(0), T(1), J::rotated ? x.bodies.ball_turn + body.ball : nullptr};
  else
    return {x.bodies.sine[b], x.bodies.cosine[b], nullptr};
}

/// Parent coordinates to body coordinates: E p of (M3).
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> to_body(J, const Body<ScalarOf<T>>& body, const Turn<T>& turn, Vec3<T> p) {
  if constexpr (J::ball) {
    if constexpr (J::rotated) return multiply_transposed(*turn.ball, p);
    return p;
  }
  if constexpr (J::rotated) {
    const ScalarOf<T>* r = body.rotation;
    const auto row = [&](int a) { return fma(T(r[3 * a]), p.x, fma(T(r[3 * a + 1]), p.y, T(r[3 * a + 2]) * p.z)); };
    p = {row(0), row(1), row(2)};
  }
  if constexpr (!J::prismatic) {
    const T pi = p[J::i], pj = p[J::j];
    p[J::i] = fma(turn.c, pi, turn.s * pj);
    p[J::j] = fnma(turn.s, pi, turn.c * pj);
  }
  return p;
}

/// Body coordinates to parent coordinates: E^T p.
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> to_parent(J, const Body<ScalarOf<T>>& body, const Turn<T>& turn, Vec3<T> p) {
  if constexpr (J::ball) {
    if constexpr (J::rotated) return multiply(*turn.ball, p);
    return p;
  }
  if constexpr (!J::prismatic) {
    const T pi = p[J::i], pj = p[J::j];
    p[J::i] = fnma(turn.s, pj, turn.c * pi);
    p[J::j] = fma(turn.s, pi, turn.c * pj);
  }
  if constexpr (J::rotated) {
    const ScalarOf<T>* r = body.rotation;
    const auto row = [&](int a) { return fma(T(r[a]), p.x, fma(T(r[3 + a]), p.y, T(r[6 + a]) * p.z)); };
    p = {row(0), row(1), row(2)};
  }
  return p;
}

/// Origin of the body in its parent's frame: r of (M3).
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> origin(J, const Body<ScalarOf<T>>& body, T q) {
  Vec3<T> r;
  each_axis([&](int a) LOCKSTEP_INLINED { r[a] = J::off(a) ? T(body.offset[a]) : T(0); });
  if constexpr (J::prismatic) {
    const T travel = q * T(body.sign);
    if constexpr (J::rotated)
      each_axis([&](int a) LOCKSTEP_INLINED { r[a] = fma(T(body.rotation[3 * J::k + a]), travel, r[a]); });
    else
      r[J::k] += travel;
  }
  return r;
}

/// Component a of r x p, added to c, for the body's origin r.
template <class J, class T>
LOCKSTEP_INLINE T cross_component(J, const Vec3<T>& r, const Vec3<T>& p, int a, T c) {
  const int i = (a + 1) % 3, j = (a + 2) % 3;
  if (J::off(j)) c = fnma(r[j], p[i], c);
  if (J::off(i)) c = fma(r[i], p[j], c);
  return c;
}

/// r x p + c
template <class J, class T>
LOCKSTEP_INLINE Vec3<T> cross_origin_add(J joint, const Vec3<T>& r, const Vec3<T>& p, Vec3<T> c) {
  each_axis([&](int a) LOCKSTEP_INLINED { c[a] = cross_component(joint, r, p, a, c[a]); });
  return c;
}

/// Rotation of a floating root, from its coordinates to the world's.
template <class T>
LOCKSTEP_INLINE Mat3<T> rotation_of_quaternion(const T* wxyz) {
  const T w = wxyz[0], x = wxyz[1], y = wxyz[2], z = wxyz[3], two = T(2), one = T(1);
  return {{one - two * fma(y, y, z * z), two * fnma(w, z, x * y), two * fma(w, y, x * z)},
          {two * fma(w, z, x * y), one - two * fma(x, x, z * z), two * fnma(w, x, y * z)},
          {two * fnma(w, y, x * z), two * fma(w, x, y * z), one - two * fma(x, x, y * y)}};
}

/// The link's centre of mass in its body's frame, or a bolted root's.
template <class T>
LOCKSTEP_INLINE Vec3<T> center_of_link(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int l) {
  const LinkPlace<ScalarOf<T>>& place = t.link[l];
  const ScalarOf<T>* const own = batch.field(Parameter::center_of_mass);
  if (!own) return Vec3<T>::constant(place.unit_moment);
  Vec3<T> center;
  for (int k = 0; k < 3; ++k) center[k] = T::load(own + (3 * l + k) * batch.stride);
  return multiply_add(Mat3<T>::constant(place.rotation), center, Vec3<T>::constant(place.offset));
}

/// Mass distribution of body b, from the tables or of this tile.
template <class T>
LOCKSTEP_INLINE PseudoInertia<T> inertia_of(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int b) {
  if (t.has_own_inertias()) return x.bodies.inertia[b];
  const Body<ScalarOf<T>>& body = t.body[b];
  PseudoInertia<T> inertia{T(body.mass), Vec3<T>::constant(body.moment), {}};
  for (int k = 0; k < 6; ++k) inertia.second[k] = T(body.second[k]);
  return inertia;
}

}  // namespace lockstep::kernels
