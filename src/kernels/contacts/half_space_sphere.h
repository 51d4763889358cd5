// A sphere on a half-space: one slot. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The lowest point lies below the centre, along the normal.
template <class T>
void half_space_sphere(const PlacedShape<T>& plane, const PlacedShape<T>& sphere, T, Patch<T>& patch) {
  frame_of_plane(plane, patch);
  patch.gap[0] = dot(patch.normal, sphere.center - plane.center) - sphere.size[0];
  patch.point[0] = fma(patch.normal, -fma(T(ScalarOf<T>(0.5)), patch.gap[0], sphere.size[0]), sphere.center);
  patch.face[0] = T(0);
  patch.valid[0] = ~T::none();
}

}  // namespace lockstep::kernels
