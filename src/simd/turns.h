// Whole turns apart from the angle: (M80). SPDX-License-Identifier: Apache-2.0
//
// A joint that turns for ever has the angle q - 2 pi n, which stays small, and n whole turns. So its angle keeps all of
// its digits. Users see the position q, rounded.
#pragma once

#include "sincos.h"

namespace lockstep::simd {

/// An angle beyond `most_angle` loses a turn. It stays far enough from the other end to not gain it at once. Positions
/// within `surely_within` have no turns.
inline constexpr double most_angle = 3.1416, surely_within = 3.1415;

/// The most turns that are told apart by a rounded position.
template <class S>
inline constexpr S most_turns = sizeof(S) == 4 ? S(1 << 20) : S(1ll << 50);

template <class T>
struct Turned {
  T angle, turns;
};

/// The number of turns that is nearest to the angle.
template <class T>
LOCKSTEP_INLINE T whole_turns(T angle) {
  using S = typename T::Scalar;
  const T round = T(SincosConstants<S>::round);
  return (angle * T(S(0.15915494309189533577)) + round) - round;
}

/// The angle without so many turns.
template <class T>
LOCKSTEP_INLINE T without_turns(T angle, T turns) {
  using S = typename T::Scalar;
  for (const S part : SincosConstants<S>::half_pi) angle = fnma(T(S(4) * part), turns, angle);
  return angle;
}

/// The position that users see. Product and sum are rounded one by one, so it has the same bits for all instruction
/// sets.
template <class T>
LOCKSTEP_INLINE T position_of(const Turned<T>& joint) {
  return joint.turns * T(typename T::Scalar(6.28318530717958647693)) + joint.angle;
}

/// The angle and turns of a position. `kept` is the angle that was stored with it. It counts if the position is still
/// the one that belongs to it. Else the position was written by a user, and is taken as it is.
template <class T>
LOCKSTEP_INLINE Turned<T> turned(T position, T kept) {
  using S = typename T::Scalar;
  const Turned<T> stored{kept, whole_turns(position - kept)};
  const auto other = beyond(kept, T(S(most_angle))) | beyond(position_of(stored) - position, T(S(0)));
  const T turns = whole_turns(position);
  const auto countless = beyond(turns, T(most_turns<S>));  // such a position is a fault
  const T whole = select(countless, T(S(0)), turns);
  return {select(other, without_turns(position, whole), kept), select(other, whole, stored.turns)};
}

}  // namespace lockstep::simd
