// Wrenches that the user puts on links, in world axes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "orientation.h"

namespace lockstep::kernels {

/// (M8): takes them off the forces that the joints must carry. Only scenes that declare the field come here.
template <class T>
void subtract_link_wrenches(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  orientations(t, x, x.world);
  for (int l = 0; l < t.links; ++l) {
    const LinkPlace<ScalarOf<T>>& place = t.link[l];
    if (place.body < 0) continue;
    Vec3<T> torque, force;
    for (int k = 0; k < 3; ++k) {
      torque[k] = T::load(lanes.field[7] + (6 * l + k) * lanes.stride);
      force[k] = T::load(lanes.field[7] + (6 * l + 3 + k) * lanes.stride);
    }
    torque = multiply_transposed(x.world[place.body], torque);
    force = multiply_transposed(x.world[place.body], force);
    const Vec3<T> at_origin = cross_add(Vec3<T>::constant(place.offset), force, torque);
    x.force[place.body] = x.force[place.body] - force;
    x.moment[place.body] = x.moment[place.body] - at_origin;
  }
}

}  // namespace lockstep::kernels
