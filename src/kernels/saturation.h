// Servos with a limited effort: the matrix holds their gains in the lanes where they have force to spare. SPDX-License-Identifier: Apache-2.0
//
// (M57). Guessed, solved, looked at: a lane whose guess was wrong solves the step again with a better one, and its
// neighbours, whose guess stays, come to the same bits once more.
#pragma once

#include "compete.h"

namespace lockstep::kernels {

constexpr int saturation_passes = 12;  ///< more are never needed but for servos at the very edge of their limit

/// -1, 0 or 1: which end of the limit the force is beyond.
template <class T>
LOCKSTEP_INLINE T saturated(T force, T most) {
  const T slack = T(ScalarOf<T>(sizeof(ScalarOf<T>) == 4 ? 1 + 1e-6 : 1 + 1e-15)) * most;
  return select(less(slack, force), T(1), select(less(force, -slack), T(-1), T(0)));
}

/// Keeps the step as it is without these servos, and guesses from A's diagonal alone how far they would be from their
/// targets at the end of it.
template <class T>
void guess_saturation(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const int root = t.velocities - t.joints;
  const T h = T(t.dt);
  for (int i = 0; i < t.limited.count; ++i) {
    const int j = t.limited[i];
    const Servo<T> own = servo<T>(t, lanes, j);
    const T effort = feed_forward<T>(t, lanes, j), inertia = x.matrix[t.matrix.offset[root + j]];
    const T force = own.force(h, x.q[j], x.v[root + j]) + effort;
    x.drive[root + j] = fnma(h, effort, x.drive[root + j]);
    x.saturation[i] = saturated(force * inertia / fma(h, fma(h, own.kp, own.kd), inertia), T(t.effort_limit[j]));
  }
  for (int e = 0; e < t.matrix.entries; ++e) x.unlimited_matrix[e] = x.matrix[e];
  for (int i = 0; i < t.velocities; ++i) x.unlimited_drive[i] = x.drive[i];
  x.saturation_pass = 0;
}

/// A and the forces with these servos, as constants or by their gains.
template <class T>
void limited_drives(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  const int root = t.velocities - t.joints;
  const T h = T(t.dt), zero = T(0);
  for (int e = 0; e < t.matrix.entries; ++e) x.matrix[e] = x.unlimited_matrix[e];
  for (int i = 0; i < t.velocities; ++i) x.drive[i] = x.unlimited_drive[i];
  for (int i = 0; i < t.limited.count; ++i) {
    const int j = t.limited[i];
    const Servo<T> own = servo<T>(t, lanes, j);
    const T free = own.force(h, x.q[j], x.v[root + j]) + feed_forward<T>(t, lanes, j);
    const auto linear = ~(less(zero, x.saturation[i]) | less(x.saturation[i], zero));
    const T force = select(linear, free, x.saturation[i] * T(t.effort_limit[j]));
    x.drive[root + j] = fma(h, force, x.drive[root + j]);
    x.matrix[t.matrix.offset[root + j]] += select(linear, h * fma(h, own.kp, own.kd), zero);
  }
}

/// Looks at the velocities that the step came to. Changes the guess where it was wrong: all of a lane's servos at
/// first, then one at a time, which cannot go round in circles. True if a lane has to solve again.
template <class T>
bool saturation_differs(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  if (x.saturation_pass == saturation_passes) return false;
  const bool one_by_one = 2 * x.saturation_pass++ >= saturation_passes;
  const int root = t.velocities - t.joints;
  expand(t, x, t.solve_twice ? x.closing_solution : x.solution, !t.solve_twice, x.next_v);
  typename T::Mask changed = T::none();
  for (int i = 0; i < t.limited.count; ++i) {
    const int j = t.limited[i];
    const T force = servo<T>(t, lanes, j).force(T(t.dt), x.q[j], x.next_v[root + j]) + feed_forward<T>(t, lanes, j);
    const T found = saturated(force, T(t.effort_limit[j])), guess = x.saturation[i];
    auto differs = (less(found, guess) | less(guess, found)) & ~x.frozen;
    if (one_by_one) differs = differs & ~changed;
    changed = changed | differs;
    x.saturation[i] = select(differs, found, guess);
  }
  return any(changed);
}

}  // namespace lockstep::kernels
