// A cylinder on a half-space: four points of its lower rim where it stands, two where it lies. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// One point of the rim is the lowest. An upright cylinder has none, and keeps its points by a little of its own x. A
/// lying one must not have that, or its line would be off the lowest and it would roll away.
template <class T>
void half_space_cylinder(const PlacedShape<T>& plane, const PlacedShape<T>& cylinder, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  frame_of_plane(plane, patch);
  const Vec3<T> axis = cylinder.axis(2);
  const T along = dot(patch.normal, axis), radius = cylinder.size[0], half = cylinder.size[1];
  Vec3<T> down = fma(axis, along, scaled(patch.normal, T(S(-1))));
  const T own = T(S(1e-3)) * larger(T(0), fnma(T(S(20)), sqrt(dot(down, down)), T(1)));
  down = fma(cylinder.axis(0), own, down);
  const Vec3<T> u = scaled(down, radius / sqrt(dot(down, down))), v = cross(axis, u);
  const auto stands = less(T(S(0.70710678118654752)), absolute(along));
  const T cap = select(stands, -sign_of(along) * half, T(0));
  for (int slot = 0; slot < 4; ++slot) {
    const T side = T(S(slot % 2 == 0 ? 1 : -1));
    const Vec3<T> lying = fma(axis, side * half, u), standing = scaled(slot < 2 ? u : v, side);
    const Vec3<T> at = fma(axis, cap, select<T>(stands, standing, lying)) + cylinder.center;
    patch.gap[slot] = dot(patch.normal, at - plane.center);
    patch.point[slot] = fma(patch.normal, T(S(-0.5)) * patch.gap[slot], at);
    patch.face[slot] = select(stands, select(less(along, T(0)), T(1), T(0)), T(2));
    patch.valid[slot] = slot < 2 ? ~T::none() : stands;
  }
}

}  // namespace lockstep::kernels
