// What an impulse on a body gives all velocities. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// Subtracts from `sum`, over all velocities, what an impulse at a point of a body and a moment give them, in the
/// world.
template <class T>
void subtract_impulse(const Tables<ScalarOf<T>>& t, const Motion<T>& m, int body, const Vec3<T>& point,
                      const Vec3<T>& impulse, const Vec3<T>& own_moment, T* sum) {
  for (; body >= 0; body = t.body[body].parent) {
    const Body<ScalarOf<T>>& own = t.body[body];
    const Vec3<T> moment = cross_add(point - m.place[body], impulse, own_moment);
    const auto along = [&](const Vec3<T>& v, int axis)
                           LOCKSTEP_INLINED { return dot(column_of(m.world[body], axis), v); };
    if (own.root)
      for (int k = 0; k < 3; ++k) {
        sum[own.velocity + k] -= along(moment, k);
        sum[own.velocity + 3 + k] -= along(impulse, k);
      }
    else
      sum[own.velocity] = fnma(T(own.sign), along(own.prismatic ? impulse : moment, own.axis), sum[own.velocity]);
  }
}

}  // namespace lockstep::kernels
