// Ball joints: their positions are rotation vectors, their velocities angular velocities. SPDX-License-Identifier:
// Apache-2.0
//
// Section 42, (M173) to (M176).
#pragma once

#include "frame.h"
#include "simd/turns.h"

namespace lockstep::kernels {

constexpr double half_turn = 3.14159;  ///< rad: a range of an angle that ends here or beyond holds nothing

template <class T>
struct Quaternion {
  T w;
  Vec3<T> v;
};

/// (M173): the turn by a rotation vector.
template <class T>
LOCKSTEP_INLINE Quaternion<T> turn_by(const Vec3<T>& vector) {
  using S = ScalarOf<T>;
  const T half = T(S(0.5)), squared = dot(vector, vector), angle = sqrt(squared);
  T sine, cosine;
  sincos(angle * half, sine, cosine);
  const auto tiny = less(squared, T(S(1e-12)));
  const T ratio = select(tiny, half, sine / select(tiny, T(1), angle));
  return {cosine, scaled(vector, ratio)};
}

template <class T>
LOCKSTEP_INLINE Quaternion<T> product(const Quaternion<T>& a, const Quaternion<T>& b) {
  return {fma(a.w, b.w, -dot(a.v, b.v)), cross_add(a.v, b.v, fma(b.v, a.w, scaled(a.v, b.w)))};
}

/// The angle whose tangent is x, over x, for 0 <= x <= tan(pi / 8): Cephes (Moshier 1992).
template <class T>
LOCKSTEP_INLINE T angle_over_tangent(T x) {
  using S = ScalarOf<T>;
  const T z = x * x;
  const auto c = [](double number) LOCKSTEP_INLINED { return T(S(number)); };
  if constexpr (sizeof(S) == 4) {
    const T sum =
        fma(fma(fma(c(8.05374449538e-2), z, c(-1.38776856032e-1)), z, c(1.99777106478e-1)), z, c(-3.33329491539e-1));
    return fma(sum, z, T(1));
  } else {
    const T above = fma(fma(fma(fma(c(-8.750608600031904122785e-1), z, c(-1.615753718733365076637e1)), z,
                                c(-7.500855792314704667340e1)),
                            z, c(-1.228866684490136173410e2)),
                        z, c(-6.485021904942025371773e1));
    const T below = fma(fma(fma(fma(z + c(2.485846490142306297962e1), z, c(1.650270098316988542046e2)), z,
                                c(4.328810604912902668951e2)),
                            z, c(4.853903996359136964868e2)),
                        z, c(1.945506571482613964425e2));
    return fma(z, above / below, T(1));
  }
}

/// (M174): the rotation vector of a turn near a unit quaternion, with the angle from 0 to 2 pi.
template <class T>
LOCKSTEP_INLINE Vec3<T> vector_of(const Quaternion<T>& turn) {
  using S = ScalarOf<T>;
  const T one = T(1), squared = dot(turn.v, turn.v), size = sqrt(fma(turn.w, turn.w, squared)), sine = sqrt(squared);
  // The tangent of a quarter of the smaller angle, and of an eighth.
  const T quarter = one / (absolute(turn.w) + size), tangent = sine * quarter;
  const T eighth = one / (one + sqrt(fma(tangent, tangent, one)));
  const T ratio = T(S(8)) * angle_over_tangent(tangent * eighth) * (quarter * eighth);
  const auto beyond_pi = less(turn.w, T(0));
  const T around = T(S(6.28318530717958647693)) / select(beyond_pi, sine, one) - ratio;
  return scaled(turn.v, select(beyond_pi, around, ratio));
}

template <class T>
LOCKSTEP_INLINE Vec3<T> at_ball(const BallJoint& ball, const T* q) {
  return {q[ball.joint], q[ball.joint + 1], q[ball.joint + 2]};
}

/// The relative angular velocity of a ball, along its child's axes; `first` is the velocity of its first part.
template <class T>
LOCKSTEP_INLINE Vec3<T> spin_of_ball(int first, const T* v) {
  return {v[first], v[first + 1], v[first + 2]};
}

template <class T>
LOCKSTEP_INLINE void put_at_ball(const BallJoint& ball, const Vec3<T>& vector, T* q) {
  for (int k = 0; k < 3; ++k) q[ball.joint + k] = vector[k];
}

/// From child to parent coordinates, at the positions q.
template <class T>
void turn_balls(const Tables<ScalarOf<T>>& t, const T* q, Tile<T>& x) {
  for (int i = 0; i < t.balls.count; ++i) {
    const Body<ScalarOf<T>>& body = t.body[t.balls[i].body];
    const Quaternion<T> turn = turn_by(at_ball(t.balls[i], q));
    const T wxyz[4] = {turn.w, turn.v[0], turn.v[1], turn.v[2]};
    const Mat3<T> own = rotation_of_quaternion(wxyz), before = Mat3<T>::constant(body.rotation);
    for (int c = 0; c < 3; ++c) {
      const Vec3<T> column = multiply_transposed(before, column_of(own, c));
      for (int r = 0; r < 3; ++r) x.bodies.ball_turn[i](r, c) = column[r];
    }
  }
}

/// Moves all balls with their parts of `v`, from the positions `q` to `next`. Positions beyond pi stay continuous.
template <class T>
void move_balls(const Tables<ScalarOf<T>>& t, ScalarOf<T> time, const T* v, const T* q, T* next) {
  for (int i = 0; i < t.balls.count; ++i) {
    const Vec3<T> way = scaled(spin_of_ball(t.balls[i].velocity, v), T(time));
    put_at_ball(t.balls[i], vector_of(product(turn_by(at_ball(t.balls[i], q)), turn_by(way))), next);
  }
}

/// The same where `next` already has q plus the way, which is taken as one turn.
template <class T>
void turn_along_ways(const Tables<ScalarOf<T>>& t, const T* q, T* next) {
  for (int i = 0; i < t.balls.count; ++i) {
    const Vec3<T> from = at_ball(t.balls[i], q), way = at_ball(t.balls[i], next) - from;
    put_at_ball(t.balls[i], vector_of(product(turn_by(from), turn_by(way))), next);
  }
}

/// (M176): the rates of the rotation vectors at the positions q, into `rate` by ball.
template <class T>
LOCKSTEP_INLINE Vec3<T> rate_of_ball(const BallJoint& ball, const T* q, const T* v) {
  using S = ScalarOf<T>;
  const T half = T(S(0.5)), one = T(1);
  const Vec3<T> vector = at_ball(ball, q), w = spin_of_ball(ball.velocity, v);
  const T squared = dot(vector, vector), angle = sqrt(squared);
  T sine, cosine;
  sincos(angle * half, sine, cosine);
  // (1 - x cot x) / (2 x)^2 with x half the angle; 1/12 at 0.
  const auto small = less(squared, T(S(sizeof(S) == 4 ? 1e-3 : 1e-5)));
  const T cotangent = cosine / select(small, one, sine);
  const T share = select(small, fma(squared, T(S(1.0 / 720)), T(S(1.0 / 12))),
                         (one - half * angle * cotangent) / select(small, one, squared));
  const Vec3<T> turning = cross(vector, w);
  return fma(cross(vector, turning), share, fma(turning, half, w));
}

/// Positions beyond pi become the opposite vectors, which are so far within that they stay.
template <class T>
void wrap_balls(const Tables<ScalarOf<T>>& t, T* q) {
  using S = ScalarOf<T>;
  const T whole = T(S(6.28318530717958647693));
  for (int i = 0; i < t.balls.count; ++i) {
    const Vec3<T> vector = at_ball(t.balls[i], q);
    const T angle = sqrt(dot(vector, vector));
    const auto beyond_pi = less(T(S(simd::most_angle)), angle);
    const T share = select(beyond_pi, T(1) - whole / select(beyond_pi, angle, T(1)), T(1));
    put_at_ball(t.balls[i], scaled(vector, share), q);
  }
}

}  // namespace lockstep::kernels
