// Wrenches that the user applies to links, in world axes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"

namespace lockstep::kernels {

/// (M8): subtracts them from the forces that the joints must supply. Runs only if the field is declared, and after
/// orientations().
template <class T>
void subtract_link_wrenches(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int l = 0; l < t.links; ++l) {
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body < 0) continue;
    Vec3<T> torque, force;
    for (int k = 0; k < 3; ++k) {
      torque[k] = T::load(batch.field(Parameter::link_wrench) + (6 * l + k) * batch.stride);
      force[k] = T::load(batch.field(Parameter::link_wrench) + (6 * l + 3 + k) * batch.stride);
    }
    torque = multiply_transposed(x.bodies.orientation[place.body], torque);
    force = multiply_transposed(x.bodies.orientation[place.body], force);
    const Vec3<T> at_origin = cross_add(Vec3<T>::constant(place.offset), force, torque);
    x.bodies.force[place.body] = x.bodies.force[place.body] - force;
    x.bodies.moment[place.body] = x.bodies.moment[place.body] - at_origin;
  }
}

}  // namespace lockstep::kernels
