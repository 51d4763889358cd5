// Faces of convex shapes, as polygons. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "support.h"

namespace lockstep::kernels {

/// The face that looks most along a direction, in the shape's frame. A cylinder's cap is an octagon, its side a line.
template <class T>
struct Face {
  Vec3<T> normal;  // outwards, length 1
  Vec3<T> corner[most_face_corners];
  int corners;  // the same in all lanes: the last ones may be equal
  T number;
};

/// Whether it can be the reference of a flat contact.
template <class T>
LOCKSTEP_INLINE bool has_faces(const Core<T>& core) {
  return core.kind == ShapeKind::box || core.kind == ShapeKind::hull || core.kind == ShapeKind::cylinder;
}

template <class T>
void face_of_box(const Core<T>& core, const Vec3<T>& d, Face<T>& face) {
  using S = ScalarOf<T>;
  T most = T(-1), chosen = T(0);
  for (int k = 0; k < 3; ++k) {
    const auto more = less(most, absolute(d[k]));
    most = select(more, absolute(d[k]), most), chosen = select(more, T(S(k)), chosen);
  }
  face.normal = Vec3<T>::zero();
  Vec3<T> across[2] = {Vec3<T>::zero(), Vec3<T>::zero()};  // half the edges of the face
  Vec3<T> middle = Vec3<T>::zero();
  T negative = T(0);
  for (int k = 0; k < 3; ++k) {
    const auto own = less(T(S(k - 0.5)), chosen) & less(chosen, T(S(k + 0.5)));
    const T side = select(own, sign_of(d[k]), T(0));
    face.normal[k] = side, middle[k] = side * core.size[k];
    negative = select(less(side, T(0)), T(1), negative);
    across[0][(k + 1) % 3] = select(own, core.size[(k + 1) % 3], across[0][(k + 1) % 3]);
    across[1][(k + 2) % 3] = select(own, core.size[(k + 2) % 3], across[1][(k + 2) % 3]);
  }
  face.corners = 4;
  for (int c = 0; c < 4; ++c)
    face.corner[c] = fma(across[0], T(S(c == 0 || c == 3 ? -1 : 1)), fma(across[1], T(S(c < 2 ? -1 : 1)), middle));
  face.number = fma(T(S(2)), chosen, negative);
}

/// Of normals (M170).
template <class T>
LOCKSTEP_INLINE Vec3<T> unscaled_by(const Core<T>& core, const Vec3<T>& v) {
  return {v.x / core.scale[0], v.y / core.scale[1], v.z / core.scale[2]};
}

/// The face whose normal is most along d.
template <class T>
T farthest_scaled(const Core<T>& core, const Vec3<T>& d) {
  using S = ScalarOf<T>;
  const HullTable<S>& hull = *core.hull;
  const T one = T(1);
  const Vec3<T> inverse = unscaled_by(core, {one, one, one});
  T best = T(S(-1e30)), number = T(0);
  for (int f = 0; f < hull.faces; ++f) {
    const Vec3<T> n{inverse.x * T(hull.normal[0][f]), inverse.y * T(hull.normal[1][f]),
                    inverse.z * T(hull.normal[2][f])};
    const T along = dot(n, d) / sqrt(dot(n, n));
    const auto farther = less(best, along);
    best = select(farther, along, best), number = select(farther, T(S(f)), number);
  }
  return number;
}

template <class T>
void face_of_hull(const Core<T>& core, const Vec3<T>& d, Face<T>& face) {
  const HullTable<ScalarOf<T>>& hull = *core.hull;
  face.number = core.scale ? farthest_scaled(core, d) : farthest(hull.normal, hull.faces, d);
  face.normal = {gather(hull.normal[0], face.number), gather(hull.normal[1], face.number),
                 gather(hull.normal[2], face.number)};
  if (core.scale) {
    const Vec3<T> turned = unscaled_by(core, face.normal);
    face.normal = scaled(turned, T(1) / sqrt(dot(turned, turned)));
  }
  face.corners = hull.face_corners;
  for (int c = 0; c < hull.face_corners; ++c)
    face.corner[c] = corner_of(core, gather(hull.face_corner[c], face.number));
}

/// A corner of the octagon lies where d looks. An upright cylinder keeps its corners: along its own x.
template <class T>
void face_of_cylinder(const Core<T>& core, const Vec3<T>& d, Face<T>& face) {
  using S = ScalarOf<T>;
  constexpr double diagonal = 0.70710678118654752;
  const T side = sign_of(d.z), r = core.size[0], half = core.size[1];
  const T x = d.x + T(S(1e-3)), inverse = T(1) / sqrt(larger(fma(x, x, d.y * d.y), T(S(1e-20))));
  const T ux = x * inverse, uy = d.y * inverse;
  const auto cap = less(T(S(0.7)), absolute(d.z));
  const T squared = fma(d.x, d.x, d.y * d.y), length = sqrt(select(cap, T(1), squared));
  const T nx = d.x / length, ny = d.y / length;
  face.corners = 8;
  for (int c = 0; c < 8; ++c) {
    const double even[] = {1, 0, -1, 0}, odd[] = {diagonal, -diagonal, -diagonal, diagonal};
    const T cosine = T(S(c % 2 == 0 ? even[c / 2] : odd[c / 2])),
            sine = T(S(c % 2 == 0 ? even[(c / 2 + 3) % 4] : odd[(c / 2 + 3) % 4]));
    face.corner[c] = {r * select(cap, fnma(uy, sine, ux * cosine), nx), r * select(cap, fma(ux, sine, uy * cosine), ny),
                      select(cap, side * half, c == 0 ? -half : half)};
  }
  face.normal = {select(cap, T(0), nx), select(cap, T(0), ny), select(cap, side, T(0))};
  face.number = select(cap, select(less(side, T(0)), T(1), T(0)), T(S(2)));
}

/// Of a core that has faces, or is a segment.
template <class T>
void face_of(const Core<T>& core, const Vec3<T>& d, Face<T>& face) {
  switch (core.kind) {
    case ShapeKind::box: return face_of_box(core, d, face);
    case ShapeKind::hull: return face_of_hull(core, d, face);
    case ShapeKind::cylinder: return face_of_cylinder(core, d, face);
    default:
      face.normal = Vec3<T>::zero(), face.number = T(0), face.corners = 2;
      for (int c = 0; c < 2; ++c) face.corner[c] = {T(0), T(0), c == 0 ? -core.size[1] : core.size[1]};
  }
}

}  // namespace lockstep::kernels
