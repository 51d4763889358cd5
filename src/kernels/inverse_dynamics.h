// Accelerations of the bodies by those of the velocities, and what acts through their joints then.
// SPDX-License-Identifier: Apache-2.0
//
// (M151) and (M152), in world axes. Not part of a step: for plans that record accelerations.
#pragma once

#include "kernels/dynamics/bias_forces.h"
#include "kernels/loops/find_loops.h"

namespace lockstep::kernels {

/// By body, in the world.
template <class T>
struct InverseDynamics {
  Vec3<T>* turning;  // acceleration: angular, and of the origin
  Vec3<T>* moving;
  Vec3<T>* force;  // through its joint, about its origin
  Vec3<T>* moment;

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    const int bodies = t.record_accelerations ? t.bodies : 0;
    take("inverse_dynamics.turning", turning, bodies);
    take("inverse_dynamics.moving", moving, bodies);
    take("inverse_dynamics.force", force, bodies);
    take("inverse_dynamics.moment", moment, bodies);
  }

  /// Where the bodies move by `m`, with x.records.acceleration.
  void accelerate(const Tables<ScalarOf<T>>& t, const Motion<T>& m, const Tile<T>& x) {
    for (int b = 0; b < t.bodies; ++b) {
      const Body<ScalarOf<T>>& body = t.body[b];
      const T* const own = x.records.acceleration + body.velocity;
      if (body.root) {
        turning[b] = multiply(m.world[b], Vec3<T>{own[0], own[1], own[2]});
        moving[b] = multiply(m.world[b], cross_add(m.angular[b], m.linear[b], Vec3<T>{own[3], own[4], own[5]}));
      } else {
        accelerate_body(t, m, x, b, scaled(column_of(m.world[b], body.axis), *own * T(body.sign)), turning, moving);
      }
    }
  }

  /// A force at a point, and a torque, act on a body from outside.
  void act(const Motion<T>& m, int body, const Vec3<T>& point, const Vec3<T>& outer, const Vec3<T>& torque) {
    if (body < 0) return;
    force[body] = force[body] - outer;
    moment[body] = moment[body] - cross_add(point - m.place[body], outer, torque);
  }

  /// After accelerate().
  void find_wrenches(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Motion<T>& m,
                     const Tile<T>& x) {
    const Vec3<T> g = world_gravity<T>(t, batch), none = Vec3<T>::zero();
    for (int b = 0; b < t.bodies; ++b) {
      const Vec3<T> falls = fma(g, T(-t.tree[t.body[b].tree].gravity_share), moving[b]);
      Vec3<T> own_force, own_moment;
      inertial_forces(inertia_of(t, x, b), false,
                      acceleration_tensor(m.angular[b], multiply_transposed(m.world[b], turning[b])),
                      multiply_transposed(m.world[b], falls), own_force, own_moment);
      force[b] = multiply(m.world[b], own_force), moment[b] = multiply(m.world[b], own_moment);
    }

    const auto vector_at = [&](const ScalarOf<T>* rows, int row) {
      return Vec3<T>{T::load(rows + row * batch.stride), T::load(rows + (row + 1) * batch.stride),
                     T::load(rows + (row + 2) * batch.stride)};
    };
    if (const ScalarOf<T>* const wrenches = batch.field(Parameter::link_wrench))
      for (int l = 0; l < t.links; ++l) {
        const LinkPlace<ScalarOf<T>>& place = t.link[l];
        if (place.body < 0) continue;
        act(m, place.body, multiply_add(m.world[place.body], Vec3<T>::constant(place.offset), m.place[place.body]),
            vector_at(wrenches, 6 * l + 3), vector_at(wrenches, 6 * l));
      }
    for (int i = 0; i < t.own_weights.count; ++i) {
      const int l = t.own_weights[i], b = t.link[l].body;
      act(m, b, multiply_add(m.world[b], center_of_link<T>(t, batch, l), m.place[b]),
          scaled(g, own_weight<T>(t, batch, l)), none);
    }
    for (int c = 0; c < t.contacts.contacts.count; ++c) {
      const TouchingPair<ScalarOf<T>>& pair = t.contacts.pairs[t.contacts.contacts[c].first];
      const Vec3<T>&outer = x.records.contact_force[c], &torque = x.records.contact_moment[c];
      act(m, t.contacts.colliders[pair.second].body, none, outer, torque);
      act(m, t.contacts.colliders[pair.first].body, none, none - outer, none - torque);
    }
    for (int l = 0; l < t.loops.loops.count; ++l) {
      const HeldLoop<ScalarOf<T>>& loop = t.loops.loops[l];
      const Vec3<T> point = in_world(m, loop.second, Mat3<T>::constant(loop.second_rotation),
                                     Vec3<T>::constant(loop.second_offset))
                                .origin,
                    outer = vector_at(batch.loop_force, 6 * l), torque = vector_at(batch.loop_force, 6 * l + 3);
      act(m, loop.second, point, outer, torque);
      act(m, loop.first, point, none - outer, none - torque);
    }

    for (int b = t.bodies - 1; b >= 0; --b) {
      const int p = t.body[b].parent;
      if (p < 0) continue;
      force[p] = force[p] + force[b];
      moment[p] = cross_add(m.place[b] - m.place[p], force[b], moment[p] + moment[b]);
    }
  }
};

}  // namespace lockstep::kernels
