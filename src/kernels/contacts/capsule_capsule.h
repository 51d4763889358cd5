// Two capsules: one slot, or two where they are parallel. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The nearest points of two segments c + s a and d + t b, |a| = |b| = 1: the lines' nearest points, one clamped, then
/// the other to the first, and the first again to that (Ericson 2005, section 5.1.9). Parallel ones touch along the
/// part in which they lie side by side; its two ends are the slots.
template <class T>
void capsule_capsule(const PlacedShape<T>& first, const PlacedShape<T>& second, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  const Vec3<T> a = first.axis(2), b = second.axis(2), between = second.center - first.center;
  const T half = first.size[1], other_half = second.size[1];
  const T c = dot(a, b), along_a = dot(a, between), along_b = dot(b, between);
  const T sine = larger(fnma(c, c, T(1)), T(0));
  const auto parallel = less(sine, T(S(1e-4)));
  // Of parallel ones: the part of the first that the second lies beside, by the projections of its ends.
  const T low = fnma(other_half, absolute(c), along_a), high = fma(other_half, absolute(c), along_a);
  const T from = within(low, half), to = within(high, half);
  const T crossing = within(fnma(c, along_b, along_a) / select(parallel, T(1), sine), half);
  T s = select(parallel, T(S(0.5)) * (from + to), crossing);
  const T t = within(fma(c, s, -along_b), other_half);
  s = select(parallel, s, within(fma(c, t, along_a), half));
  touch_round(first, fma(a, s, first.center), first.size[0], fma(b, t, second.center), second.size[0], first.axis(0),
              patch);
  const T axis = patch.face[0];
  const auto side_by_side = parallel & less(T(S(1e-3)) * half, to - from);
  for (int end = 0; end < 2; ++end) {
    const T own = select(side_by_side, end == 0 ? from : to, s);
    const Vec3<T> at = fma(a, own, first.center);
    const T other = within(fma(c, own, -along_b), other_half);
    const Vec3<T> across = fma(b, select(side_by_side, other, t), second.center) - at;
    patch.gap[end] = dot(patch.normal, across) - (first.size[0] + second.size[0]);
    patch.point[end] = fma(patch.normal, fma(T(S(0.5)), patch.gap[end], first.size[0]), at);
    patch.face[end] = axis + select(side_by_side, T(3), T(0));
  }
  patch.valid[1] = side_by_side;
}

}  // namespace lockstep::kernels
