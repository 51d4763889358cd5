// Kinetic and potential energy (M52). SPDX-License-Identifier: Apache-2.0
#pragma once

#include "motion.h"

namespace lockstep::kernels {

/// With the share of the armatures.
template <class T>
T kinetic_energy(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                 const Motion<T>& m) {
  const Field<T> armature = field<T>(batch, Parameter::armature, t.armature.data);
  T twice = T(0);
  for (int b = 0; b < t.bodies; ++b) {
    Vec3<T> linear, angular;
    body_momentum(t, x, m, b, linear, angular);
    twice += dot(m.linear[b], linear) + dot(m.angular[b], angular);
  }
  for (int j = 0; j < t.joints; ++j) {
    const T v = x.state.v[t.velocity_of(j)];
    twice = fma(armature.at(j, t.dof[j]) * v, v, twice);
  }
  return twice * T(ScalarOf<T>(0.5));
}

/// In gravity, zero at the world's origin; links as (M113) shares it.
template <class T>
T potential_energy(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                   const Motion<T>& m) {
  const Vec3<T> g = world_gravity<T>(t, batch);
  T sum = T(0);
  for (int b = 0; b < t.bodies; ++b) {
    const PseudoInertia<T> body = inertia_of(t, x, b);
    T depth = dot(g, fma(m.place[b], body.mass, multiply(m.world[b], body.moment)));
    if (const ScalarOf<T> share = t.tree[t.body[b].tree].gravity_share; share != 1) depth *= T(share);
    sum = sum - depth;
  }
  for (int i = 0; i < t.own_weights.count; ++i) {
    const int l = t.own_weights[i], b = t.link[l].body;
    const Vec3<T> center = multiply_add(m.world[b], center_of_link<T>(t, batch, l), m.place[b]);
    sum = fnma(own_weight<T>(t, batch, l), dot(g, center), sum);
  }
  for (int l = 0; l < t.links; ++l) {  // links of a bolted root count as bodies at rest
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body >= 0) continue;
    const TreePlace<ScalarOf<T>>& tree = t.tree[place.tree];
    const Vec3<T> center =
        multiply_add(Mat3<T>::constant(tree.rotation), center_of_link<T>(t, batch, l), Vec3<T>::constant(tree.offset));
    T weight = field<T>(batch, Parameter::mass, t.link_mass.data).at(l, l);
    if (place.gravity_share != 1) weight *= T(place.gravity_share);
    sum = fnma(weight, dot(g, center), sum);
  }
  return sum;
}

}  // namespace lockstep::kernels
