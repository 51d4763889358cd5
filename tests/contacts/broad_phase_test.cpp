// Spheres and boxes about colliders lose no pair that can touch. SPDX-License-Identifier: Apache-2.0
#include "kernels/contacts/broad_phase.h"

#include <gtest/gtest.h>

#include "solids.h"

namespace lockstep::contacts_test {
namespace {

constexpr ShapeKind kinds[] = {ShapeKind::box,     ShapeKind::hull,      ShapeKind::cylinder,
                               ShapeKind::capsule, ShapeKind::ellipsoid, ShapeKind::sphere};

// Half the edges of the box about it, by its supports; and how far from its centre it reaches.
template <class T>
kernels::MovingCollider<T> bounded(const Solid& solid, const kernels::PlacedShape<T>& shape) {
  using S = simd::ScalarOf<T>;
  kernels::MovingCollider<T> place{};
  place.shape = shape;
  Vector3d half;
  for (int k = 0; k < 3; ++k)
    half[k] = solid.radius() + std::max(solid.support(Vector3d::Unit(k))[k], -solid.support(-Vector3d::Unit(k))[k]);
  for (int k = 0; k < 3; ++k) place.half[k] = T(static_cast<S>(half[k]));
  place.reach = T(static_cast<S>(half.norm()));
  return place;
}

template <class T>
void put(const Matrix3d& rotation, const Vector3d& center, kernels::PlacedShape<T>& shape) {
  using S = simd::ScalarOf<T>;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) shape.rotation(r, c) = T(static_cast<S>(rotation(r, c)));
    shape.center[r] = T(static_cast<S>(center[r]));
  }
}

template <class T>
Vector3d normal_of(const kernels::PlacedShape<T>& shape) {
  const simd::Vec3<T> axis = shape.axis(2);
  return {axis.x.lane(0), axis.y.lane(0), axis.z.lane(0)};
}

// Two shapes at a known distance along a normal, anywhere in the world. Boxes must let a margin of that distance pass,
// and are of use only if they stop most of what is far.
template <class T>
void expect_boxes_keep_what_is_near() {
  using S = simd::ScalarOf<T>;
  Random random(7);
  int stopped = 0, far = 0;
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds)
      for (int n = 0; n < 2000; ++n) {
        const Solid a = draw_solid(first, random), b = draw_solid(second, random);
        const Matrix3d turn = random.rotation(), world = random.rotation();
        const Vector3d normal = random.direction(), origin = random.within(-3.0, 3.0);
        const double distance = std::array{-0.01, 0.0, 0.005, 0.05}[static_cast<std::size_t>(n % 4)];
        const Vector3d place = a.support(normal) + (distance + a.radius() + b.radius()) * normal -
                               turn * b.support(-(turn.transpose() * normal));
        kernels::PlacedShape<T> one, other;
        put(world, origin, one), put(Matrix3d(world * turn), Vector3d(origin + world * place), other);
        const auto meet = [&](double margin) {
          return any(kernels::boxes_meet(bounded(a, one), bounded(b, other), T(static_cast<S>(margin))));
        };
        ASSERT_TRUE(meet(std::max(0.005, distance))) << to_string(first) << " and " << to_string(second);
        if (n % 4 != 3) continue;
        ++far, stopped += !meet(0.005);
      }
  EXPECT_GT(stopped, 0.8 * far);
}

TEST(BroadPhase, boxes_keep_what_is_near) {
  expect_boxes_keep_what_is_near<f64>();
  expect_boxes_keep_what_is_near<f32>();
}

// Whatever two bodies do, spheres must meet where the distance is below the margin (M103) of the pair.
template <class T>
void expect_spheres_keep_what_is_near() {
  using S = simd::ScalarOf<T>;
  Random random(8);
  Tables<S> tables{};
  tables.dt = S(0.01);
  int near_pairs = 0, stopped = 0;
  for (int n = 0; n < 100000; ++n) {
    const double reach[] = {random.within(0.01, 0.3)[0], random.within(0.01, 0.3)[0]};
    kernels::MovingCollider<T> bodies[2];
    Vector3d center[2], velocity[2], angular[2], origin[2];
    for (int i = 0; i < 2; ++i) {
      center[i] = random.within(-0.5, 0.5), origin[i] = random.within(-0.5, 0.5);
      const double fast = std::array{0.1, 3.0, 30.0}[static_cast<std::size_t>(n % 3)];
      velocity[i] = random.within(-fast, fast), angular[i] = random.within(-fast, fast);
      if (i == n % 2) velocity[i] = angular[i] = Vector3d::Zero();
      if (n % 4 > 1) velocity[i] = angular[i].cross(origin[i] - center[i]);  // it turns about its centre
      put(random.rotation(), center[i], bodies[i].shape);
      for (int k = 0; k < 3; ++k) {
        bodies[i].place[k] = T(static_cast<S>(origin[i][k]));
        bodies[i].linear[k] = T(static_cast<S>(velocity[i][k]));
        bodies[i].angular[k] = T(static_cast<S>(angular[i][k]));
      }
      bodies[i].reach = T(static_cast<S>(reach[i]));
      kernels::bound_pairs(tables, bodies[i]);
    }
    const auto speed_at = [&](int i, const Vector3d& p) -> Vector3d {
      return velocity[i] + angular[i].cross(p - origin[i]);
    };
    const double margin = 0.02 * ((angular[1] - angular[0]).norm() * reach[1] +
                                  (speed_at(1, center[1]) - speed_at(0, center[1])).norm()) +
                          kernels::least_margin;
    const bool is_near = (center[1] - center[0]).norm() - reach[0] - reach[1] < margin;
    const bool meet = any(kernels::spheres_meet(ShapeKind::box, bodies[0], bodies[1]));
    ASSERT_TRUE(meet || !is_near);
    near_pairs += is_near, stopped += !meet && !is_near;

    // On a half-space, which stands still.
    const Vector3d up = normal_of(bodies[0].shape);
    const double plane_margin =
        0.02 * (angular[1].norm() * reach[1] + speed_at(1, center[1]).norm()) + kernels::least_margin;
    const bool is_low = up.dot(center[1] - center[0]) - reach[1] < plane_margin;
    ASSERT_TRUE(any(kernels::spheres_meet(ShapeKind::half_space, bodies[0], bodies[1])) || !is_low);
  }
  EXPECT_GT(near_pairs, 10000);
  EXPECT_GT(stopped, 10000);
}

TEST(BroadPhase, spheres_keep_what_is_near) {
  expect_spheres_keep_what_is_near<f64>();
  expect_spheres_keep_what_is_near<f32>();
}

}  // namespace
}  // namespace lockstep::contacts_test
