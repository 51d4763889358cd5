// A capsule and a sphere: one slot. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The point of the capsule's axis that is nearest to the sphere's centre is its projection, clamped to the ends.
template <class T>
void capsule_sphere(const PlacedShape<T>& capsule, const PlacedShape<T>& sphere, T, Patch<T>& patch) {
  const Vec3<T> axis = capsule.axis(2);
  const T along = within(dot(axis, sphere.center - capsule.center), capsule.size[1]);
  touch_round(capsule, fma(axis, along, capsule.center), capsule.size[0], sphere.center, sphere.size[0],
              capsule.axis(0), patch);
}

}  // namespace lockstep::kernels
