// An ellipsoid on a half-space: its lowest point. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "support.h"

namespace lockstep::kernels {

template <class T>
void half_space_ellipsoid(const PlacedShape<T>& plane, const PlacedShape<T>& ellipsoid, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  frame_of_plane(plane, patch);
  const Core<T> core{ShapeKind::ellipsoid, {ellipsoid.size[0], ellipsoid.size[1], ellipsoid.size[2]}};
  const Vec3<T> down = scaled(multiply_transposed(ellipsoid.rotation, patch.normal), T(S(-1)));
  const Vec3<T> at = multiply_add(ellipsoid.rotation, support(core, down).point, ellipsoid.center);
  patch.gap[0] = dot(patch.normal, at - plane.center);
  patch.point[0] = fma(patch.normal, T(S(-0.5)) * patch.gap[0], at);
  patch.face[0] = T(0);
  patch.valid[0] = ~T::none();
}

}  // namespace lockstep::kernels
