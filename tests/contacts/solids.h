// Convex solids in double, with supports by their definition, for tests of pairs that have no form of their own.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/contacts/convex.h"
#include "model/hull.h"
#include "patches.h"

namespace lockstep::contacts_test {

struct Solid {
  ShapeKind kind;
  Vector3d size;  // as kernels::PlacedShape has it
  Eigen::Matrix3Xd corners = {};

  double radius() const { return kind == ShapeKind::sphere || kind == ShapeKind::capsule ? size[0] : 0.0; }

  /// Of the core: without the radius of capsules and spheres.
  Vector3d support(const Vector3d& d) const {
    switch (kind) {
      case ShapeKind::cylinder: {
        const Vector2d flat = d.head<2>().normalized() * size[0];
        return {flat.x(), flat.y(), d.z() < 0.0 ? -size[1] : size[1]};
      }
      case ShapeKind::ellipsoid: {
        const Vector3d s = size.cwiseProduct(d);
        return size.cwiseProduct(s) / s.norm();
      }
      case ShapeKind::capsule: return {0.0, 0.0, d.z() < 0.0 ? -size[1] : size[1]};
      case ShapeKind::sphere: return Vector3d::Zero();
      default: {
        Eigen::Index best = 0;
        (d.transpose() * corners).maxCoeff(&best);
        return corners.col(best);
      }
    }
  }
};

inline Solid cuboid(const Vector3d& half, ShapeKind kind) {
  Solid solid{kind, half, Eigen::Matrix3Xd(3, 8)};
  for (int i = 0; i < 8; ++i)
    solid.corners.col(i) = half.cwiseProduct(Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  return solid;
}

/// Of 2 to 16 cm. A hull has 6 to 32 corners.
inline Solid draw_solid(ShapeKind kind, Random& random) {
  Solid solid{kind, random.within(0.02, 0.08)};
  if (kind == ShapeKind::box) return cuboid(solid.size, kind);
  if (kind != ShapeKind::hull) return solid;
  solid.corners.resize(3, 6 + random.below(27));
  for (int i = 0; i < solid.corners.cols(); ++i)
    solid.corners.col(i) =
        solid.size.cwiseProduct(i < 6 ? Vector3d((i % 2 ? 1 : -1) * Vector3d::Unit(i / 2)) : random.direction());
  solid.corners = hull_of(solid.corners).corners;
  return solid;
}

/// Of the second against the first along n, in the first's frame.
inline double separation_along(const Solid& a, const Solid& b, const Matrix3d& turn, const Vector3d& place,
                               const Vector3d& n) {
  return n.dot(turn * b.support(-(turn.transpose() * n)) + place - a.support(n));
}

/// A core of the kernels, and the tables of its hull.
template <class T>
class CoreOf {
  using S = simd::ScalarOf<T>;

 public:
  explicit CoreOf(const Solid& solid) {
    core.kind = solid.kind;
    for (int k = 0; k < 3; ++k) core.size[k] = T(static_cast<S>(solid.kind == ShapeKind::hull ? 0.0 : solid.size[k]));
    core.hull = &hull_;
    if (solid.kind != ShapeKind::hull) return;
    const Hull hull = hull_of(solid.corners);
    hull_.corners = static_cast<int>(hull.corners.cols()), hull_.faces = static_cast<int>(hull.faces.size());
    for (const HullFace& face : hull.faces)
      hull_.face_corners = std::max(hull_.face_corners, static_cast<int>(face.corners.size()));
    for (int k = 0; k < 3; ++k) {
      for (Eigen::Index c = 0; c < hull.corners.cols(); ++c) corner_[k].push_back(static_cast<S>(hull.corners(k, c)));
      for (const HullFace& face : hull.faces) normal_[k].push_back(static_cast<S>(face.normal[k]));
      hull_.corner[k] = corner_[k].data(), hull_.normal[k] = normal_[k].data();
    }
    for (int c = 0; c < hull_.face_corners; ++c) {
      for (const HullFace& face : hull.faces)
        face_corner_[c].push_back(static_cast<S>(face.corners[std::min<std::size_t>(c, face.corners.size() - 1)]));
      hull_.face_corner[c] = face_corner_[c].data();
    }
  }
  CoreOf(const CoreOf&) = delete;
  CoreOf& operator=(const CoreOf&) = delete;

  kernels::Core<T> core;

 private:
  HullTable<S> hull_;
  std::vector<S> corner_[3], normal_[3], face_corner_[most_face_corners];
};

}  // namespace lockstep::contacts_test
