// Efforts of drives in a solve: servo and feed-forward effort together, at most their limit.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "joint_terms.h"

namespace lockstep::kernels {

/// (M147): act(joint, effort) for all joints, where a solve that began at x.state ends with the velocities v.
template <class T, class Act>
LOCKSTEP_INLINE void each_drive_effort(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch,
                                       const Tile<T>& x, int time, const T* v, Act&& act) {
  const Span<int>* const servos[] = {&t.servos, &t.limited_servos, &t.row_servos};
  int next[3] = {0, 0, 0};
  for (int j = 0; j < t.joints; ++j) {
    bool has_servo = false;
    for (int k = 0; k < 3; ++k) {
      while (next[k] < servos[k]->count && (*servos[k])[next[k]] < j) ++next[k];
      has_servo |= next[k] < servos[k]->count && (*servos[k])[next[k]] == j;
    }
    T effort = feed_forward<T>(t, batch, j, time);
    const T most = effort_limit<T>(t, batch, j);
    if (has_servo) effort += servo_of_solve<T>(t, batch, x, j, time).force(T(t.dt), x.state.q[j], v[t.velocity_of(j)]);
    act(j, clamp(effort, -most, most));
  }
}

}  // namespace lockstep::kernels
