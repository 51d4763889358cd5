// Servos with a limited effort: the matrix holds their gains in the lanes where they have force to spare.
// SPDX-License-Identifier: Apache-2.0
//
// (M63). Guessed, solved, looked at: a lane whose guess was wrong solves the step again with a better one, and its
// neighbours, whose guess stays, come to the same bits once more.
#pragma once

#include "solve_bounds.h"

namespace lockstep::kernels {

constexpr int saturation_passes = 12;  ///< more are never needed but for servos at the very edge of their limit

template <class T>
LOCKSTEP_INLINE void first_saturation_pass(Tile<T>& x) {
  x.servos.pass = 0;
}

/// -1, 0 or 1: which end of the limit the force is beyond.
template <class T>
LOCKSTEP_INLINE T saturated(T force, T most) {
  const T slack = T(ScalarOf<T>(sizeof(ScalarOf<T>) == 4 ? 1 + 1e-6 : 1 + 1e-15)) * most;
  return select(less(slack, force), T(1), select(less(force, -slack), T(-1), T(0)));
}

/// Adds these servos to A and the forces, as constants or by their gains. In the first pass guesses which, from A's
/// diagonal alone: how much of the force will be left once the joint has given way to it.
template <class T>
void limited_drives(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const T h = T(t.dt), zero = T(0);
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const int j = t.limited_servos[i];
    const Servo<T> own = servo<T>(t, batch, j);
    const T effort = feed_forward<T>(t, batch, j), most = T(t.effort_limit[j]);
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

/// Looks at the velocities that the step came to. Changes the guess where it was wrong: all of a lane's servos at
/// first, then one at a time, which cannot go round in circles. True if a lane has to solve again.
template <class T>
bool saturation_differs(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (x.servos.pass == saturation_passes) return false;
  const bool one_by_one = 2 * x.servos.pass++ >= saturation_passes;
  typename T::Mask changed = T::none();
  for (int i = 0; i < t.limited_servos.count; ++i) {
    const int j = t.limited_servos[i];
    const T force =
        servo<T>(t, batch, j).force(T(t.dt), x.state.q[j], x.next.v[t.velocity_of(j)]) + feed_forward<T>(t, batch, j);
    // From one end to the other by way of the middle: a servo that jumps may jump back for ever.
    const T guess = x.servos.saturation[i], found = saturated(force, T(t.effort_limit[j]));
    const T next = guess + clamp(found - guess, T(-1), T(1));
    auto differs = (less(found, guess) | less(guess, found)) & ~x.frozen;
    if (one_by_one) differs = differs & ~changed;
    changed = changed | differs;
    x.servos.saturation[i] = select(differs, next, guess);
  }
  return any(changed);
}

}  // namespace lockstep::kernels
