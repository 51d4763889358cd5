// Sines and cosines of the joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../simd/sincos.h"
#include "frame.h"

namespace lockstep::kernels {

template <class T>
void kinematics(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Span<Mirror> mirrors = t.reduction.mirrors;
  const Mirror* next = mirrors.data;
  const Mirror* const last = next + (x.in_place ? mirrors.count : 0);
  for (int b = t.floating ? 1 : 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (next != last && next->body == b) {
      ++next;
      continue;
    }
    if (body.prismatic) continue;
    sincos(x.q[joint_of(t, b)] * T(body.sign), x.sine[b], x.cosine[b]);
  }
  for (const Mirror* mirror = mirrors.data; mirror != last; ++mirror) {
    const T sine = x.sine[mirror->driver];
    x.sine[mirror->body] = mirror->opposed ? -sine : sine;
    x.cosine[mirror->body] = x.cosine[mirror->driver];
  }
}

}  // namespace lockstep::kernels
