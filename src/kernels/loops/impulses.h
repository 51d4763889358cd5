// What the loops of a step did: their impulses on all velocities, and their forces. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/dynamics/wrench.h"

namespace lockstep::kernels {

/// The impulse and its moment about the loop's point, on the second body, in the world.
template <class T>
struct LoopImpulse {
  Vec3<T> linear, angular;
};

template <class T>
LOCKSTEP_INLINE LoopImpulse<T> impulse_of_loop(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int l) {
  const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
  const T* const impulse = x.loops.impulse + (t.solve_twice ? t.loops.rows : 0) + loop.row;
  LoopImpulse<T> sum{Vec3<T>::zero(), Vec3<T>::zero()};
  for (int i = 0; i < loop.translations; ++i) sum.linear = fma(x.loops.frames[l].axes[i], impulse[i], sum.linear);
  for (int i = 0; i < loop.rotations; ++i)
    sum.angular = fma(x.loops.frames[l].axes[i], impulse[loop.translations + i], sum.angular);
  return sum;
}

/// Subtracts J^T of the last solve's impulses from `sum`, over all velocities.
template <class T>
void subtract_loops(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T* sum) {
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
    const LoopImpulse<T> own = impulse_of_loop(t, x, l);
    const Vec3<T> none = Vec3<T>::zero(), &point = x.loops.frames[l].point;
    subtract_impulse(t, x.loops.motion, loop.second, point, own.linear, own.angular, sum);
    subtract_impulse(t, x.loops.motion, loop.first, point, none - own.linear, none - own.angular, sum);
  }
}

/// What Quantity::loop_force shows: the impulses of all solves of a step, then their mean force over it.
template <class T>
void clear_loop_forces(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int k = 0; k < 6 * t.loops.loops.count; ++k) x.loops.force[k] = T(0);
}
template <class T>
void add_loop_impulses(const Tables<ScalarOf<T>>& t, typename T::Mask lanes, Tile<T>& x) {
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const LoopImpulse<T> own = impulse_of_loop(t, x, l);
    for (int k = 0; k < 3; ++k) {
      x.loops.force[6 * l + k] += select(lanes, own.linear[k], T(0));
      x.loops.force[6 * l + 3 + k] += select(lanes, own.angular[k], T(0));
    }
  }
}
template <class T>
void end_loop_forces(const Tables<ScalarOf<T>>& t, ScalarOf<T> duration, Tile<T>& x) {
  for (int k = 0; k < 6 * t.loops.loops.count; ++k) x.loops.force[k] *= T(ScalarOf<T>(1) / duration);
}

}  // namespace lockstep::kernels
