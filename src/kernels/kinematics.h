// Sines and cosines of the joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../simd/sincos.h"
#include "frame.h"

namespace lockstep::kernels {

template <class T>
void kinematics(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int b = t.floating ? 1 : 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.prismatic) continue;
    sincos(x.q[joint_of(t, b)] * T(body.sign), x.sine[b], x.cosine[b]);
  }
}

}  // namespace lockstep::kernels
