// A hull on a half-space: the lowest corner, and those that are low to four sides. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "support.h"

namespace lockstep::kernels {

/// Four directions lean by 0.03 from straight down, unlike along the two tangents, so that a square does not have two
/// corners alike. The lowest corner takes the highest one's place where it is lower than all of them by more than
/// `slack`. It is not always a corner of the face that looks most down.
template <class T>
void half_space_hull(const PlacedShape<T>& plane, const Core<T>& hull, const PlacedShape<T>& placed, T slack,
                     Patch<T>& patch) {
  using S = ScalarOf<T>;
  frame_of_plane(plane, patch);
  const auto seen = [&](const Vec3<T>& v) LOCKSTEP_INLINED { return multiply_transposed(placed.rotation, v); };
  const Vec3<T> down = scaled(seen(patch.normal), T(S(-1))), t = seen(patch.tangent), u = seen(patch.other_tangent);
  const T height = dot(patch.normal, placed.center - plane.center) - radius_of(hull);
  SupportPoint<T> corner[4];
  const SupportPoint<T> lowest = support(hull, down);
  T highest = T(S(1e30)), least = T(S(-1e30));  // along `down`
  for (int slot = 0; slot < 4; ++slot) {
    const T right = T(S(slot % 2 == 0 ? -0.03 : 0.03)), up = T(S(slot < 2 ? -0.0306 : 0.0306));
    corner[slot] = support(hull, fma(t, right, fma(u, up, down)));
    const T along = dot(down, corner[slot].point);
    highest = smaller(highest, along), least = larger(least, along);
  }
  auto open = less(slack, dot(down, lowest.point) - least);
  for (int slot = 0; slot < 4; ++slot) {
    const auto here = open & ~less(highest, dot(down, corner[slot].point));
    corner[slot].point = select<T>(here, lowest.point, corner[slot].point);
    corner[slot].number = select(here, lowest.number, corner[slot].number);
    open = open & ~here;

    auto valid = ~T::none();
    for (int earlier = 0; earlier < slot; ++earlier)
      valid = valid & ~equal(corner[earlier].number, corner[slot].number);
    patch.gap[slot] = height - dot(down, corner[slot].point);
    const Vec3<T> at = multiply_add(placed.rotation, corner[slot].point, placed.center);
    patch.point[slot] = fma(patch.normal, -fma(T(S(0.5)), patch.gap[slot], radius_of(hull)), at);
    patch.face[slot] = corner[slot].number;
    patch.valid[slot] = valid;
  }
}

}  // namespace lockstep::kernels
