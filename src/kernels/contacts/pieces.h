// The pieces of their laws on which bounds and servos end a solve with contacts: where the next one begins.
// SPDX-License-Identifier: Apache-2.0
//
// (M107). A solve that has to find them anew moves them one after the other where much moves. A piece is kept as a
// number: 0 sticks, -1 and 1 slip with that sign of the impulse, -2 and 2 hold an end of the interval.
#pragma once

#include "kernels/bounds/held_velocities.h"

namespace lockstep::kernels {

constexpr double unknown_piece = 3.0;

template <class T>
LOCKSTEP_INLINE T number_of(const Branch<T>& own) {
  using S = ScalarOf<T>;
  const T slips = select(less(own.impulse, T(0)), T(S(-1)), T(S(1)));
  return select(own.stuck, T(0), select(own.low, T(S(-2)), select(own.high, T(S(2)), slips)));
}

/// Bounds of single velocities with the friction `force`.
template <class T>
LOCKSTEP_INLINE Branch<T> piece_of(T number, T force) {
  using S = ScalarOf<T>;
  const T size = absolute(number);
  const auto at_end = less(T(S(1.5)), size), sticks = less(size, T(S(0.5))), low = less(number, T(0));
  return {at_end & low, at_end & ~low, sticks, select(at_end | sticks, T(0), clamp(number, T(S(-1)), T(S(1))) * force)};
}

/// Keeps the pieces of a solve in these lanes.
template <class T>
void keep_pieces(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int r = 0; r < t.bounds.single; ++r)
    x.contacts.piece[r] = select(lanes, number_of(x.search.branch[r]), x.contacts.piece[r]);
  for (int i = 0; i < t.limited_servos.count; ++i)
    x.contacts.saturation[i] = select(lanes, x.servos.saturation[i], x.contacts.saturation[i]);
}

/// The pieces of lanes in which no contact acts are not known in the next step.
template <class T>
void forget_pieces(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  const T unknown = T(ScalarOf<T>(unknown_piece));
  for (int r = 0; r < t.bounds.single; ++r) x.contacts.piece[r] = select(lanes, unknown, x.contacts.piece[r]);
  for (int i = 0; i < t.limited_servos.count; ++i)
    x.contacts.saturation[i] = select(lanes, unknown, x.contacts.saturation[i]);
}

/// A solve begins on the pieces that are kept, in these lanes and where they are known.
template <class T>
void begin_on_pieces(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  const T most = T(ScalarOf<T>(unknown_piece - 0.5));
  for (int r = 0; r < t.bounds.single; ++r) {
    const T kept = x.contacts.piece[r];
    replace(x.search.branch[r], piece_of(kept, x.bounds.force[r]), lanes & less(kept, most));
  }
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const T kept = x.contacts.saturation[i];
    const auto taken = lanes & less(kept, most) & searched(t, x, i) & ~x.servos.decided;
    x.servos.saturation[i] = select(taken, kept, x.servos.saturation[i]);
  }
}

}  // namespace lockstep::kernels
