// The points of a convex shape that are farthest along a direction. SPDX-License-Identifier: Apache-2.0
//
// A shape is its core and a radius about it: a sphere is a point, a capsule a segment. Cores with corners number them,
// so a corner is found again without a search.
#pragma once

#include "shapes.h"

namespace lockstep::kernels {

/// A core in its own frame. All lanes have the same kind and corners.
template <class T>
struct Core {
  ShapeKind kind;
  T size[3];                                // of the shape, as in PlacedShape
  const HullTable<ScalarOf<T>>* hull = {};  // of a hull
  const T* scale = {};                      // of a hull, along its axes, where sizes differ
};

/// `number` is that of the corner; 0 where the core has none.
template <class T>
struct SupportPoint {
  Vec3<T> point;
  T number;
};

/// Of two whole numbers.
template <class T>
LOCKSTEP_INLINE typename T::Mask equal(T a, T b) {
  return ~(less(a, b) | less(b, a));
}

/// (M170).
template <class T>
LOCKSTEP_INLINE Vec3<T> scaled_by(const Core<T>& core, const Vec3<T>& v) {
  return {core.scale[0] * v.x, core.scale[1] * v.y, core.scale[2] * v.z};
}

/// A corner by its number, the first one for numbers that there are not. Bits of a box's numbers are the signs of x, y
/// and z.
template <class T>
LOCKSTEP_INLINE Vec3<T> corner_of(const Core<T>& core, T number) {
  using S = ScalarOf<T>;
  const T count = T(S(core.kind == ShapeKind::hull ? core.hull->corners : 8));
  number = select(~less(number, T(0)) & less(number, count), number, T(0));
  if (core.kind == ShapeKind::hull) {
    const Vec3<T> at{gather(core.hull->corner[0], number), gather(core.hull->corner[1], number),
                     gather(core.hull->corner[2], number)};
    return core.scale ? scaled_by(core, at) : at;
  }
  Vec3<T> at;
  for (int k = 2; k >= 0; --k) {
    const T bit = T(S(1 << k));
    const auto set = ~less(number, bit);
    number = select(set, number - bit, number);
    at[k] = select(set, core.size[k], -core.size[k]);
  }
  return at;
}

template <class T>
LOCKSTEP_INLINE SupportPoint<T> support_of_box(const Core<T>& core, const Vec3<T>& d) {
  using S = ScalarOf<T>;
  SupportPoint<T> found{{}, T(0)};
  for (int k = 0; k < 3; ++k) {
    const auto negative = less(d[k], T(0));
    found.point[k] = select(negative, -core.size[k], core.size[k]);
    found.number += select(negative, T(0), T(S(1 << k)));
  }
  return found;
}

/// Which of `count` vectors is farthest along d, in four chains that do not wait for each other. Of equal ones the
/// first of a chain wins.
template <class T>
LOCKSTEP_INLINE T farthest(const ScalarOf<T>* const (&vectors)[3], int count, const Vec3<T>& d) {
  using S = ScalarOf<T>;
  constexpr int chains = 4;
  T best[chains], number[chains];
  for (int c = 0; c < chains; ++c) best[c] = T(S(-1e30)), number[c] = T(0);
  const auto consider = [&](int c, int i) LOCKSTEP_INLINED {
    const T along = fma(T(vectors[0][i]), d.x, fma(T(vectors[1][i]), d.y, T(vectors[2][i]) * d.z));
    const auto farther = less(best[c], along);
    best[c] = select(farther, along, best[c]);
    number[c] = select(farther, T(S(i)), number[c]);
  };
  int i = 0;
  for (; i + chains <= count; i += chains)
    for (int c = 0; c < chains; ++c) consider(c, i + c);
  for (; i < count; ++i) consider(i % chains, i);
  for (int c = 1; c < chains; ++c) {
    const auto farther = less(best[0], best[c]);
    best[0] = select(farther, best[c], best[0]);
    number[0] = select(farther, number[c], number[0]);
  }
  return number[0];
}

/// Farthest along d, which need not have length 1.
template <class T>
LOCKSTEP_INLINE SupportPoint<T> support(const Core<T>& core, const Vec3<T>& d) {
  using S = ScalarOf<T>;
  switch (core.kind) {
    case ShapeKind::box: return support_of_box(core, d);
    case ShapeKind::hull: {
      const T number = farthest(core.hull->corner, core.hull->corners, core.scale ? scaled_by(core, d) : d);
      return {corner_of(core, number), number};
    }
    case ShapeKind::cylinder: {
      const T squared = fma(d.x, d.x, d.y * d.y);
      const auto leans = less(T(S(1e-24)), squared);
      const T across = core.size[0] / sqrt(select(leans, squared, T(1)));
      return {{select(leans, d.x * across, T(0)), select(leans, d.y * across, T(0)), sign_of(d.z) * core.size[1]},
              T(0)};
    }
    case ShapeKind::ellipsoid: {
      Vec3<T> stretched;
      for (int k = 0; k < 3; ++k) stretched[k] = core.size[k] * d[k];
      const T inverse = T(1) / sqrt(dot(stretched, stretched));
      for (int k = 0; k < 3; ++k) stretched[k] = stretched[k] * core.size[k] * inverse;
      return {stretched, T(0)};
    }
    case ShapeKind::capsule: return {{T(0), T(0), sign_of(d.z) * core.size[1]}, T(0)};
    default: return {Vec3<T>::zero(), T(0)};
  }
}

/// What a shape has about its core.
template <class T>
LOCKSTEP_INLINE T radius_of(const Core<T>& core) {
  return core.kind == ShapeKind::sphere || core.kind == ShapeKind::capsule || core.kind == ShapeKind::hull
             ? core.size[0]
             : T(0);
}

/// Whether it can touch in more than one point.
template <class T>
LOCKSTEP_INLINE bool has_extent(const Core<T>& core) {
  return core.kind != ShapeKind::sphere && core.kind != ShapeKind::ellipsoid;
}

template <class T>
LOCKSTEP_INLINE bool has_corners(const Core<T>& core) {
  return core.kind == ShapeKind::box || core.kind == ShapeKind::hull;
}

}  // namespace lockstep::kernels
