// Two spheres: one slot. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// Along the line of centres.
template <class T>
void sphere_sphere(const PlacedShape<T>& first, const PlacedShape<T>& second, T, Patch<T>& patch) {
  touch_round(first, first.center, first.size[0], second.center, second.size[0], first.axis(2), patch);
}

}  // namespace lockstep::kernels
