// A box on a half-space: a slot for each corner of one face. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// The face whose axis is most along the normal, on its lower side. The lowest corner of a box is always one of its
/// four: a corner off this face is higher than its neighbour on it.
template <class T>
void half_space_box(const PlacedShape<T>& plane, const PlacedShape<T>& box, T, Patch<T>& patch) {
  using S = ScalarOf<T>;
  frame_of_plane(plane, patch);
  Vec3<T> edge[3];
  T along[3], most = T(-1), chosen = T(0);
  for (int k = 0; k < 3; ++k) {
    edge[k] = scaled(box.axis(k), box.size[k]);
    along[k] = dot(patch.normal, box.axis(k));
    const auto more = less(most, absolute(along[k]));
    most = select(more, absolute(along[k]), most);
    chosen = select(more, T(S(k)), chosen);
  }
  const auto first = less(chosen, T(S(0.5))), last = less(T(S(1.5)), chosen);
  const auto of = [&](const Vec3<T>& a, const Vec3<T>& b, const Vec3<T>& c)
                      LOCKSTEP_INLINED { return select<T>(first, a, select<T>(last, c, b)); };
  const T side = sign_of(select(first, along[0], select(last, along[2], along[1])));
  const Vec3<T> middle = fma(of(edge[0], edge[1], edge[2]), -side, box.center);
  const Vec3<T> u = of(edge[1], edge[2], edge[0]), v = of(edge[2], edge[0], edge[1]);
  for (int corner = 0; corner < 4; ++corner) {
    const Vec3<T> at = fma(u, T(S(corner % 2 == 0 ? -1 : 1)), fma(v, T(S(corner < 2 ? -1 : 1)), middle));
    patch.gap[corner] = dot(patch.normal, at - plane.center);
    patch.point[corner] = fma(patch.normal, T(S(-0.5)) * patch.gap[corner], at);
    patch.face[corner] = fma(T(S(2)), chosen, select(less(side, T(0)), T(1), T(0)));
    patch.valid[corner] = ~T::none();
  }
}

}  // namespace lockstep::kernels
