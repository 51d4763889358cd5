// A capsule on a half-space: a slot for each end. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The deepest point is that of the lower end's sphere, or of both.
template <class T>
void half_space_capsule(const PlacedShape<T>& plane, const PlacedShape<T>& capsule, T, Patch<T>& patch) {
  frame_of_plane(plane, patch);
  for (int end = 0; end < 2; ++end) {
    const Vec3<T> center = fma(capsule.axis(2), end == 0 ? -capsule.size[1] : capsule.size[1], capsule.center);
    patch.gap[end] = dot(patch.normal, center - plane.center) - capsule.size[0];
    patch.point[end] = fma(patch.normal, -fma(T(ScalarOf<T>(0.5)), patch.gap[end], capsule.size[0]), center);
    patch.face[end] = T(0);
    patch.valid[end] = ~T::none();
  }
}

}  // namespace lockstep::kernels
