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

/// In gravity, zero at the world's origin.
template <class T>
T potential_energy(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                   const Motion<T>& m) {
  Vec3<T> g;
  for (int k = 0; k < 3; ++k) g[k] = field<T>(batch, Parameter::gravity, t.gravity).at(k, k);
  T sum = T(0);
  for (int b = 0; b < t.bodies; ++b) {
    const PseudoInertia<T> body = inertia_of(t, x, b);
    sum = sum - dot(g, fma(m.place[b], body.mass, multiply(m.world[b], body.moment)));
  }
  for (int l = 0; l < t.links; ++l) {  // links of a bolted root count as bodies at rest
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body >= 0) continue;
    const TreePlace<ScalarOf<T>>& tree = t.tree[place.tree];
    const Vec3<T> center =
        multiply_add(Mat3<T>::constant(tree.rotation), center_of_link<T>(t, batch, l), Vec3<T>::constant(tree.offset));
    sum = fnma(field<T>(batch, Parameter::mass, t.link_mass.data).at(l, l), dot(g, center), sum);
  }
  return sum;
}

}  // namespace lockstep::kernels
