// The check before the state changes: an environment that fails keeps its last good state; joints that turn for ever
// lose their whole turns.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/couplings/turns.h"

namespace lockstep::kernels {

/// The largest of `most`, which is not negative, and the magnitudes of the numbers. NaN is larger than any number.
template <class T>
LOCKSTEP_INLINE T farthest(const T* numbers, int count, T most) {
  for (int i = 0; i < count; ++i) most = farther(most, numbers[i]);
  return most;
}

/// The same over the positions of joints that do not turn for ever and the floating roots' poses.
template <class T>
LOCKSTEP_INLINE T farthest_position(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  T most = farthest(x.next.pose, 7 * t.roots.count, T(0));
  if (t.turning.count == 0) return farthest(x.next.q, t.joints, most);
  for (int i = 0; i < t.not_turning.count; ++i) most = farther(most, x.next.q[t.not_turning[i]]);
  return most;
}

/// Sets the fault of lanes that have just failed and have none yet. A matrix that cannot be factored comes first,
/// because it explains any numbers that follow from it.
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

/// Flags the lanes that have just failed. Frozen lanes get back the state in which the step began; in the others,
/// joints lose their whole turns.
template <class T>
void hold(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, typename T::Mask failed) {
  if (any(failed)) flag(t, batch, x, failed);
  each_part<T>(t, [&](T* State<T>::*part, int count) LOCKSTEP_INLINED {
    for (int i = 0; i < count; ++i) (x.next.*part)[i] = select(x.frozen, (x.state.*part)[i], (x.next.*part)[i]);
  });
  if (t.turning.count > 0) take_turns(t, batch, x);
}

template <class T>
LOCKSTEP_INLINE void hold_if(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x,
                             typename T::Mask held, typename T::Mask failed) {
  if (any(held)) hold(t, batch, x, failed);
}

/// Freezes lanes that failed, and moves the others to their new state.
template <class T>
void check(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const auto far = beyond(farthest_position(t, x), T(t.position_bound));
  const auto fast = beyond(farthest(x.next.v, t.velocities, T(0)), T(t.velocity_bound));
  const typename T::Mask failed = (x.singular | far | fast) & ~x.frozen;
  x.frozen = x.frozen | failed;
  typename T::Mask held = x.frozen;
  if (t.turning.count > 0) {
    T angle = T(0);
    for (int i = 0; i < t.turning.count; ++i) angle = farther(angle, x.next.q[t.turning[i]]);
    held = held | beyond(angle, T(ScalarOf<T>(simd::most_angle)));
  }
  hold_if(t, batch, x, held, failed);

  copy_state(t, x.next, x.state);
}

}  // namespace lockstep::kernels
