// Drift: what the integration of positions adds to the relative motion of two colliders. SPDX-License-Identifier:
// Apache-2.0
//
// (M111). A step solves for velocities at its start, and moves a hand along an arc but a free body along a line. Each
// step they part by a term of second order, which no friction sees, as it acts on velocities: a held object would
// creep. So a pair remembers where its velocities should have taken it, and its contacts take the difference back.
#pragma once

#include "assembly.h"
#include "simd/sincos.h"

namespace lockstep::kernels {

constexpr double most_turn = 0.05;  // (M111), rad: pairs that turn further in a step have no drift

/// The drift of the pair since the step before, in the frame of the contact, in lanes where the pair has been `held`
/// and nobody else has moved it.
/// What may be rounding stays for later and fades, or a resting pair would tremble. `angle` is the turn of the pair
/// in a step: what turns by more than most_turn rolls and is no longer held, and a line says nothing of its way.
template <class T>
LOCKSTEP_INLINE void find_drift(typename T::Mask held, T angle, ContactPatch<T>& patch) {
  using S = ScalarOf<T>;
  const Vec3<T> expected[3] = {patch.expected_axis, patch.expected_other_axis,
                               cross(patch.expected_axis, patch.expected_other_axis)};
  Vec3<T> turned = Vec3<T>::zero();  // twice the small turn from the expected axes to the present ones
  for (int k = 0; k < 3; ++k) turned = cross_add(expected[k], column_of(patch.turn, k), turned);
  const Vec3<T> turning = multiply(patch.frame, scaled(turned, T(S(0.5)))),
                moving = multiply(patch.frame, patch.place - patch.expected_place);
  const T far = T(1) + absolute(patch.center.x) + absolute(patch.center.y) + absolute(patch.center.z);
  const T rounding = T(S(3)) * T::rounding();
  const T counted = smaller(larger(fnma(angle, T(S(2 / most_turn)), T(2)), T(0)), T(1));
  // Rounding of single precision is not to be seen in a speed, and does not add up to a walk.
  const T gain = T(S(sizeof(S) == 4 ? 0.25 : 1.0)), fading = T(S(sizeof(S) == 4 ? 0.01 : 0.0));
  for (int i = 0; i < 3; ++i) {
    const T turn = select(held, counted * dot(patch.axes[i], turning), T(0)),
            move = select(held, counted * dot(patch.axes[i], moving), T(0));
    const T small_turn = within(turn, rounding), small_move = within(move, far * rounding);
    patch.drift_turning[i] = gain * (turn - small_turn), patch.drift_moving[i] = gain * (move - small_move);
    patch.kept_turning[i] = fnma(fading, small_turn, turn - patch.drift_turning[i]);
    patch.kept_moving[i] = fnma(fading, small_move, move - patch.drift_moving[i]);
  }
}

/// From the frame of the contact to that of the first collider.
template <class T>
LOCKSTEP_INLINE Vec3<T> in_first_frame(const ContactPatch<T>& patch, const Vec3<T>& v) {
  const Vec3<T> world = fma(patch.axes[0], v.x, fma(patch.axes[1], v.y, scaled(patch.axes[2], v.z)));
  return multiply_transposed(patch.frame, world);
}

/// The pair's twist at the velocities z, in the frame of its first collider, at the second one's centre. Both bodies
/// are seen at the reference point here, also where each has its friction on its own surface.
template <class T>
RelativeTwist<T> twist_in_frame(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair,
                                const ContactPatch<T>& patch, const Tile<T>& x, const T* z) {
  RelativeTwist<T> twist = twist_of(t, pair, x, z, true);
  for (int k = pair.column; k < pair.column + pair.columns; ++k)
    twist.moving = fma(x.contacts.parted[k], -z[t.contacts.columns[k].velocity], twist.moving);
  const Vec3<T> turning = in_first_frame(patch, twist.turning);
  const Vec3<T> arm = multiply_transposed(patch.frame, patch.center - patch.point);
  return {turning, cross_add(turning, arm, in_first_frame(patch, twist.moving))};
}

/// Where the velocities z would put the pair after the time h, without the drift that is left for later.
template <class T>
void expect(const Tables<ScalarOf<T>>& t, const TouchingPair<ScalarOf<T>>& pair, const T* z, typename T::Mask lanes,
            ContactPatch<T>& patch, const Tile<T>& x) {
  using S = ScalarOf<T>;
  const RelativeTwist<T> twist = twist_in_frame(t, pair, patch, x, z);
  const T h = T(t.dt), squared = dot(twist.turning, twist.turning), angle = h * sqrt(squared);
  T sine, cosine;
  sincos(angle, sine, cosine);
  // Rodrigues' formula by sin a / a and (1 - cos a) / a^2, which near 0 are 1 and 1/2. The second loses digits there.
  const auto small = less(angle, T(S(1e-2)));
  const T a2 = angle * angle, safe = select(small, T(1), angle);
  const T first = select(small, fnma(a2, T(S(1.0 / 6)), T(1)), sine / safe);
  const T second = select(small, fnma(a2, T(S(1.0 / 24)), T(S(0.5))), (T(1) - cosine) / (safe * safe));
  const Vec3<T> turn = scaled(twist.turning, h), kept_turning = in_first_frame(patch, patch.kept_turning);
  const auto turned = [&](int k) LOCKSTEP_INLINED {
    const Vec3<T> axis = column_of(patch.turn, k);
    const Vec3<T> across = cross(turn, axis);
    return fma(cross(turn, across), second, fma(across, first, axis - cross(kept_turning, axis)));
  };
  const Vec3<T> place = fma(twist.moving, h, patch.place - in_first_frame(patch, patch.kept_moving));
  patch.expected_place = select<T>(lanes, place, patch.expected_place);
  patch.expected_axis = select<T>(lanes, turned(0), patch.expected_axis);
  patch.expected_other_axis = select<T>(lanes, turned(1), patch.expected_other_axis);
}

}  // namespace lockstep::kernels
