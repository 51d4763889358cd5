// How high points around a link are above the ground: Quantity::height_scan. SPDX-License-Identifier: Apache-2.0
//
// The ground is what stands still: half-spaces, height fields that are upright, and boxes.
#pragma once

#include "height_field.h"
#include "place_collider.h"

namespace lockstep::kernels {

/// Raises `height` to that of the surface at x, y, where there is one, all in the world.
template <class T>
void raise_to(const Tables<ScalarOf<T>>& t, int collider, const PlacedShape<T>& ground, T x, T y, T& height) {
  using S = ScalarOf<T>;
  const Vec3<T> from{x - ground.center.x, y - ground.center.y, T(0)};
  switch (t.contacts.colliders[collider].kind) {
    case ShapeKind::half_space: {
      const Vec3<T> n = ground.axis(2);
      const auto looks_up = less(T(S(1e-3)), n.z);
      const T at = ground.center.z - fma(n.x, from.x, n.y * from.y) / select(looks_up, n.z, T(1));
      height = select(looks_up & less(height, at), at, height);
      return;
    }
    case ShapeKind::height_field: {
      const HeightTable<S> field = height_field_of(t.contacts, t.contacts.colliders[collider].table);
      const Facet<T> facet = facet_below(field, ground, multiply_transposed(ground.rotation, from));
      const T at = facet.height + ground.center.z;
      height = select(facet.inside & less(height, at), at, height);
      return;
    }
    default: {  // a box: where the vertical line leaves all three pairs of faces
      T low = T(S(-1e30)), high = T(S(1e30));
      for (int k = 0; k < 3; ++k) {
        const Vec3<T> axis = ground.axis(k);
        const T middle = dot(axis, from), size = ground.size[k];
        const auto crosses = less(T(S(1e-6)), absolute(axis.z));
        const T rate = T(1) / select(crosses, axis.z, T(1)), one = (size - middle) * rate,
                other = (-size - middle) * rate;
        const auto between = less(absolute(middle), size);
        low = larger(low, select(crosses, smaller(one, other), select(between, T(S(-1e30)), T(S(1e30)))));
        high = smaller(high, select(crosses, larger(one, other), select(between, T(S(1e30)), T(S(-1e30)))));
      }
      const T at = ground.center.z + high;
      height = select(less(low, high) & less(height, at), at, height);
    }
  }
}

/// Of `count` points about a frame, x and y of each in its yaw: numbers has a row of T::lanes for each. `frame` has
/// the rows of read_frames(). Infinite where there is no ground.
template <class T>
void scan_heights(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const ScalarOf<T>* frame,
                  const ScalarOf<T>* points, int count, ScalarOf<T>* numbers, void* scratch) {
  using S = ScalarOf<T>;
  Tile<T> x;
  lay_out(t, scratch, x);
  load_colliders(t, batch, x);
  const auto number = [&](int row) LOCKSTEP_INLINED { return T::load(frame + row * T::lanes); };
  // The yaw turns the world's x to where the frame's x looks, seen from above.
  const T ahead = number(3), aside = number(6), length = sqrt(fma(ahead, ahead, aside * aside));
  const auto looks = less(T(S(1e-6)), length);
  const T safe = select(looks, length, T(1)), cosine = select(looks, ahead / safe, T(1)),
          sine = select(looks, aside / safe, T(0));
  for (int c = 0; c < t.contacts.colliders.count; ++c)
    if (t.contacts.colliders[c].scanned) place_collider(t, c, x.contacts);
  for (int i = 0; i < count; ++i) {
    const T along = T(points[2 * i]), across = T(points[2 * i + 1]);
    const T px = number(0) + fnma(sine, across, cosine * along), py = number(1) + fma(cosine, across, sine * along);
    T height = T(S(-__builtin_inf()));
    for (int c = 0; c < t.contacts.colliders.count; ++c)
      if (t.contacts.colliders[c].scanned) raise_to(t, c, x.contacts.collider[c].shape, px, py, height);
    store(numbers + i * T::lanes, number(2) - height);
  }
}

}  // namespace lockstep::kernels
