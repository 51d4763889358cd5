// Orientations of the bodies in the world. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// world[b]: from coordinates of body b to world coordinates. Needs kinematics().
template <class T>
void orientations(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Mat3<T>* world) {
  for (int b = 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root) {
      world[b] = rotation_of_quaternion(x.state.pose + 7 * body.joint + 3);
      continue;
    }
    const Mat3<T> parent = body.parent < 0 ? Mat3<T>::constant(t.tree[body.tree].rotation) : world[body.parent];
    with_joint(body, [&](auto joint) {  // each world axis, first in the axes of the parent, then of the body
      for (int r = 0; r < 3; ++r) {
        const Vec3<T> axis =
            to_body(joint, body, turn_of(joint, body, x, b), {parent(r, 0), parent(r, 1), parent(r, 2)});
        for (int c = 0; c < 3; ++c) world[b](r, c) = axis[c];
      }
    });
  }
}

}  // namespace lockstep::kernels
