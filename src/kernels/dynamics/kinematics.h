// How the joints turn their bodies. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "balls.h"

namespace lockstep::kernels {

/// A consistent follower that rotates by its leader's angle, or by minus that, shares its sine and cosine.
template <class T>
void kinematics(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Span<Mirror> mirrors = t.reduction.mirrors;
  const Mirror* next = mirrors.data;
  const Mirror* const last = next + (x.consistent ? mirrors.count : 0);
  for (int b = 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (next != last && next->body == b) {
      ++next;
      continue;
    }
    if (body.prismatic || body.root || body.kind >= ball_joint) continue;
    sincos(x.state.q[body.joint] * T(body.sign), x.bodies.sine[b], x.bodies.cosine[b]);
  }
  for (const Mirror* mirror = mirrors.data; mirror != last; ++mirror) {
    const T sine = x.bodies.sine[mirror->leader];
    x.bodies.sine[mirror->body] = mirror->opposed ? -sine : sine;
    x.bodies.cosine[mirror->body] = x.bodies.cosine[mirror->leader];
  }
  if (t.balls.count > 0) turn_balls(t, x.state.q, x);
}

}  // namespace lockstep::kernels
