// Last look before the state changes: an environment that failed keeps its last good state. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// The largest magnitude, `most` among it, which is not negative. What is no number is larger than any.
template <class T>
LOCKSTEP_INLINE T farthest(const T* numbers, int count, T most) {
  for (int i = 0; i < count; ++i) most = farther(most, numbers[i]);
  return most;
}

/// Of positions, the root's pose among them.
template <class T>
LOCKSTEP_INLINE T farthest_position(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  return farthest(x.next.q, t.joints, farthest(x.next.pose, t.floating ? 7 : 0, T(0)));
}

/// First fault of a lane, sticky. A matrix that cannot be factored explains whatever numbers came of it.
template <class T>
void flag(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
          typename T::Mask failed) {
  const T farthest_number = farthest(x.next.v, t.velocities, farthest_position(t, x));
  const typename T::Mask infinite = beyond(farthest_number, T(largest_number<ScalarOf<T>>));
  for (int i = 0; i < T::lanes; ++i) {
    if (!lane(failed, i) || batch.fault[i] != Fault::none) continue;
    batch.fault[i] = lane(x.singular, i) ? Fault::singular : lane(infinite, i) ? Fault::not_finite : Fault::diverged;
  }
}

/// Flags what failed just now, and lets the frozen lanes end the step as they began it.
template <class T>
void hold(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, typename T::Mask failed) {
  if (any(failed)) flag(t, batch, x, failed);
  for (int j = 0; j < t.joints; ++j) x.next.q[j] = select(x.frozen, x.state.q[j], x.next.q[j]);
  for (int i = 0; i < t.velocities; ++i) x.next.v[i] = select(x.frozen, x.state.v[i], x.next.v[i]);
  for (int i = 0; t.floating && i < 7; ++i) x.next.pose[i] = select(x.frozen, x.state.pose[i], x.next.pose[i]);
}

template <class T>
LOCKSTEP_INLINE void hold_frozen(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                                 typename T::Mask failed) {
  if (any(x.frozen)) hold(t, batch, x, failed);
}

/// Moves good lanes on, freezes the others.
template <class T>
void check(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const auto far = beyond(farthest_position(t, x), T(t.position_bound));
  const auto fast = beyond(farthest(x.next.v, t.velocities, T(0)), T(t.velocity_bound));
  const typename T::Mask failed = (x.singular | far | fast) & ~x.frozen;
  x.frozen = x.frozen | failed;
  hold_frozen(t, batch, x, failed);

  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.next.q[j];
  for (int i = 0; i < t.velocities; ++i) x.state.v[i] = x.next.v[i];
  for (int i = 0; t.floating && i < 7; ++i) x.state.pose[i] = x.next.pose[i];
}

}  // namespace lockstep::kernels
