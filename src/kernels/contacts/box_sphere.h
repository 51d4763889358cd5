// A box and a sphere: one slot. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The nearest point of the box to a centre outside is the centre clamped to the box. A centre inside leaves through
/// the nearest face.
template <class T>
void box_sphere(const PlacedShape<T>& box, const PlacedShape<T>& sphere, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  const Vec3<T> at = multiply_transposed(box.rotation, sphere.center - box.center);
  Vec3<T> clamped, out = Vec3<T>::zero();
  T depth = T(S(-1e30));
  for (int k = 0; k < 3; ++k) {
    clamped[k] = within(at[k], box.size[k]);
    const T beyond_face = absolute(at[k]) - box.size[k];
    const auto nearer = less(depth, beyond_face);
    for (int l = 0; l < 3; ++l) out[l] = select(nearer, l == k ? sign_of(at[k]) : T(0), out[l]);
    depth = select(nearer, beyond_face, depth);
  }
  const Vec3<T> d = at - clamped;
  const T squared = dot(d, d), distance = sqrt(squared);
  const auto outside = less(T(S(1e-18)), squared);
  const Vec3<T> n = select<T>(outside, scaled(d, T(1) / select(outside, distance, T(1))), out);
  const T radius = sphere.size[0];
  patch.normal = multiply(box.rotation, n);
  patch.gap[0] = select(outside, distance, depth) - radius;
  patch.point[0] = fma(patch.normal, -fma(T(S(0.5)), patch.gap[0], radius), sphere.center);
  patch.face[0] = tangents_along(box, patch);
  patch.valid[0] = ~T::none();
}

}  // namespace lockstep::kernels
