// Weights of links whose share of gravity is not that of their tree. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// Gravity in world axes, whatever share of it acts.
template <class T>
LOCKSTEP_INLINE Vec3<T> world_gravity(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch) {
  Vec3<T> g;
  for (int k = 0; k < 3; ++k) g[k] = field<T>(batch, Parameter::gravity, t.gravity).at(k, k);
  return g;
}

/// The part of link l's mass by which it weighs more than its tree's share of gravity makes it.
template <class T>
LOCKSTEP_INLINE T own_weight(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, int l) {
  const LinkPlace<ScalarOf<T>>& place = t.link[l];
  return T(place.gravity_share - t.tree[place.tree].gravity_share) *
         field<T>(batch, Parameter::mass, t.link_mass.data).at(l, l);
}

/// (M113): subtracts what they weigh beyond their tree's share from the forces that the joints must supply. Runs only
/// if there are such links, and after orientations().
template <class T>
void subtract_own_weights(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const Vec3<T> g = world_gravity<T>(t, batch);
  for (int i = 0; i < t.own_weights.count; ++i) {
    const int l = t.own_weights[i], b = t.link[l].body;
    const T weight = own_weight<T>(t, batch, l);
    const Vec3<T> force = multiply_transposed(x.bodies.orientation[b], {weight * g[0], weight * g[1], weight * g[2]});
    x.bodies.force[b] = x.bodies.force[b] - force;
    x.bodies.moment[b] = x.bodies.moment[b] - cross(center_of_link<T>(t, batch, l), force);
  }
}

}  // namespace lockstep::kernels
