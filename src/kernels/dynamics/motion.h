// Positions and velocities of the bodies, in the world and in their own axes: (M49), (M51).
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bias_forces.h"
#include "kinematics.h"
#include "orientation.h"

namespace lockstep::kernels {

/// At x.state. Needs kinematics().
template <class T>
void move_bodies(const Tables<ScalarOf<T>>& t, const Tile<T>& x, Motion<T>& m) {
  orientations(t, x, m.world);
  for (int b = 0; b < t.bodies; ++b) {
    const Body<ScalarOf<T>>& body = t.body[b];
    if (body.root) {
      const T *const pose = x.state.pose + 7 * body.joint, *const v = x.state.v + body.velocity;
      m.place[b] = {pose[0], pose[1], pose[2]};
      m.angular[b] = {v[0], v[1], v[2]};
      m.linear[b] = {v[3], v[4], v[5]};
      continue;
    }
    const int p = body.parent;
    const TreePlace<ScalarOf<T>>& tree = t.tree[body.tree];
    const Mat3<T> parent_world = p < 0 ? Mat3<T>::constant(tree.rotation) : m.world[p];
    const Vec3<T> parent_place = p < 0 ? Vec3<T>::constant(tree.offset) : m.place[p];
    const Vec3<T> zero = Vec3<T>::zero();
    with_joint(body, [&](auto joint) {
      using J = decltype(joint);
      const Turn<T> turn = turn_of(joint, body, x, b);
      const T speed = x.state.v[body.velocity] * T(body.sign);
      const Vec3<T> r = origin(joint, body, J::prismatic ? x.state.q[body.joint] : T(0));
      m.place[b] = multiply_add(parent_world, r, parent_place);
      m.angular[b] = to_body(joint, body, turn, p < 0 ? zero : m.angular[p]);
      m.linear[b] = to_body(joint, body, turn, p < 0 ? zero : cross_add(m.angular[p], r, m.linear[p]));
      (J::prismatic ? m.linear : m.angular)[b][J::k] += speed;
    });
  }
}

template <class T>
void motions(const Tables<ScalarOf<T>>& t, Tile<T>& x, Motion<T>& m) {
  kinematics(t, x);
  move_bodies(t, x, m);
}

/// How body b, on a joint, accelerates in the world, from how its parent does. `own` is what the joint's acceleration
/// adds, along its axis.
template <class T>
LOCKSTEP_INLINE void accelerate_body(const Tables<ScalarOf<T>>& t, const Motion<T>& m, const Tile<T>& x, int b,
                                     const Vec3<T>& own, Vec3<T>* turning_of, Vec3<T>* moving_of) {
  const Body<ScalarOf<T>>& body = t.body[b];
  Vec3<T>&turning = turning_of[b], &moving = moving_of[b];
  const int p = body.parent;
  turning = moving = Vec3<T>::zero();
  (body.prismatic ? moving : turning) = own;
  if (p < 0) return;
  const Vec3<T> along = column_of(m.world[b], body.axis), angular = multiply(m.world[p], m.angular[p]),
                arm = m.place[b] - m.place[p];
  Vec3<T> turned = cross(angular, scaled(along, x.state.v[body.velocity] * T(body.sign)));
  if (body.ball >= 0)
    turned = cross(angular, multiply(m.world[b], spin_of_ball(body.velocity, x.state.v)));
  else if (body.kind >= ball_joint)
    turned = Vec3<T>::zero();  // the first part has all of it, (M175)
  turning = turning + turning_of[p];
  moving = cross_add(turning_of[p], arm, cross_add(angular, cross(angular, arm), moving + moving_of[p]));
  if (body.prismatic)
    moving = fma(turned, T(2), moving);
  else
    turning = turning + turned;
}

/// Momentum of body b in its own axes, about its origin (M51).
template <class T>
LOCKSTEP_INLINE void body_momentum(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Motion<T>& m, int b,
                                   Vec3<T>& linear, Vec3<T>& angular) {
  const PseudoInertia<T> body = inertia_of(t, x, b);
  const Vec3<T> w = m.angular[b], v = m.linear[b];
  linear = cross_add(w, body.moment, {body.mass * v[0], body.mass * v[1], body.mass * v[2]});
  const T trace = body.second[0] + body.second[1] + body.second[2];
  for (int k = 0; k < 3; ++k) {
    T sum = trace * w[k];
    for (int l = 0; l < 3; ++l) sum = fnma(body.pair(k, l), w[l], sum);
    angular[k] = sum;
  }
  angular = cross_add(body.moment, v, angular);
}

}  // namespace lockstep::kernels
