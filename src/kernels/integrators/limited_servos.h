// Servos with an effort limit: the matrix has their gains only where they are below their limit.
// SPDX-License-Identifier: Apache-2.0
//
// (M63). The step guesses which servos are at their limit, solves, and checks. If the guess of a lane was wrong, the
// tile is solved again with a better one. Lanes whose guess stays get the same bits again.
#pragma once

#include "solve_bounds.h"

namespace lockstep::kernels {

constexpr int saturation_passes = 12;  ///< enough, except for servos right at the edge of their limit

template <class T>
LOCKSTEP_INLINE void first_saturation_pass(Tile<T>& x) {
  x.servos.pass = 0;
}

/// Adds these servos to A and the forces: by their gains, or as a constant force. The first pass guesses which, from
/// the diagonal of A alone: it estimates how much force is left once the joint has moved.
template <class T>
void limited_drives(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const T h = T(t.dt), zero = T(0);
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const int j = t.limited_servos[i];
    const Servo<T> own = servo<T>(t, batch, x, j);
    const T effort = feed_forward<T>(t, batch, j), most = effort_limit<T>(t, batch, j);
    const T inertia = x.dynamics.joint_inertia[j];
    const T gain = h * fma(h, own.kp, own.kd);
    const T free = own.force(h, x.state.q[j], x.state.v[t.velocity_of(j)]) + effort;
    if (x.servos.pass == 0) x.servos.saturation[i] = saturated(free * inertia / (inertia + gain), most);
    const auto linear = ~(less(zero, x.servos.saturation[i]) | less(x.servos.saturation[i], zero));
    x.dynamics.rhs[t.velocity_of(j)] =
        fma(h, select(linear, free, x.servos.saturation[i] * most) - effort, x.dynamics.rhs[t.velocity_of(j)]);
    add_inertia(t, x, j, select(linear, gain, zero));
  }
}

/// Checks the guess against the velocities that the step came to, and changes it where it was wrong: for all servos of
/// a lane at first, later for one at a time, which cannot cycle. Returns whether to solve again.
template <class T>
bool saturation_differs(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (x.servos.pass == saturation_passes) return false;
  const bool one_by_one = 2 * x.servos.pass++ >= saturation_passes;
  typename T::Mask changed = T::none();
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const int j = t.limited_servos[i];
    const T force = servo<T>(t, batch, x, j).force(T(t.dt), x.state.q[j], x.next.v[t.velocity_of(j)]) +
                    feed_forward<T>(t, batch, j);
    // Go from one end to the other through the middle: a servo that jumps could jump back for ever.
    const T guess = x.servos.saturation[i], found = saturated(force, effort_limit<T>(t, batch, j));
    const T next = guess + clamp(found - guess, T(-1), T(1));
    auto differs = (less(found, guess) | less(guess, found)) & ~x.frozen;
    if (one_by_one) differs = differs & ~changed;
    changed = changed | differs;
    x.servos.saturation[i] = select(differs, next, guess);
  }
  return any(changed);
}

}  // namespace lockstep::kernels
