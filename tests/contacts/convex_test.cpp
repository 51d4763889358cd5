// Convex shapes: separations with known answers, faces that rest on each other. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>
#include <memory>

#include "kernels/contacts/half_space_cylinder.h"
#include "kernels/contacts/half_space_ellipsoid.h"
#include "kernels/contacts/half_space_hull.h"
#include "model/rotations.h"
#include "solids.h"

namespace lockstep::contacts_test {
namespace {

using kernels::CorePair;
using kernels::Nearest;

constexpr ShapeKind kinds[] = {ShapeKind::box,     ShapeKind::hull,      ShapeKind::cylinder,
                               ShapeKind::capsule, ShapeKind::ellipsoid, ShapeKind::sphere};

struct Found {
  Vector3d normal;
  double separation;
};

template <class T>
class Separating {
  using S = simd::ScalarOf<T>;

 public:
  Separating(const Solid& a, const Solid& b) : first_(a), second_(b) {
    pair_.first = first_.core, pair_.second = second_.core;
    pair_.size = T(static_cast<S>(a.size.norm() + b.size.norm()));
  }
  Found separate(const Matrix3d& turn, const Vector3d& place, bool kept = false) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) pair_.turn(r, c) = T(static_cast<S>(turn(r, c)));
      pair_.place[r] = T(static_cast<S>(place[r]));
    }
    const auto all = ~T::none();
    kernels::separate(pair_, T(S(1e-3)), T(S(1.0)), all, kept ? all : T::none(), found_);
    return {{found_.normal.x.lane(0), found_.normal.y.lane(0), found_.normal.z.lane(0)}, found_.separation.lane(0)};
  }
  void remember(const Vector3d& normal) {
    for (int k = 0; k < 3; ++k) found_.normal[k] = T(static_cast<S>(normal[k]));
  }

 private:
  CoreOf<T> first_, second_;
  CorePair<T> pair_;
  Nearest<T> found_;
};

// The second shape lies `wanted` beyond a plane that touches the first, so that is their distance where it is above 0.
// Half of the poses begin cold, half near the answer, as a step does.
template <class T>
void expect_known_separations(int poses, double usual, double own) {
  Random random(5);
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds) {
      if (second < first) continue;
      SCOPED_TRACE(std::string(to_string(first)) + " and " + to_string(second));
      int off = 0;
      double worst = 0.0, worst_own = 0.0;
      for (int n = 0; n < poses; ++n) {
        const Solid a = draw_solid(first, random), b = draw_solid(second, random);
        const Matrix3d turn = random.rotation();
        const Vector3d normal = random.direction();
        const double wanted = std::array{1e-3, 1e-5, 1e-2}[static_cast<std::size_t>(n % 3)];
        const Vector3d place = a.support(normal) + wanted * normal - turn * b.support(-(turn.transpose() * normal));
        Separating<T> pair(a, b);
        Found found = pair.separate(turn, place);
        if (n % 2) {
          pair.remember((normal + 0.02 * random.direction()).normalized());
          found = pair.separate(turn, place, true);
        }
        const double error = std::abs(found.separation - wanted);
        worst = std::max(worst, error), off += error > usual;
        worst_own = std::max(worst_own, std::abs(found.separation - separation_along(a, b, turn, place, found.normal)));
      }
      EXPECT_LT(worst_own, own);
      EXPECT_LT(worst, 1e-4);
      EXPECT_LE(off, poses / 1000) << "of " << poses;
    }
}

TEST(Convex, shapes_that_are_apart_have_their_known_separation) {
  expect_known_separations<f64>(4000, 1e-5, 1e-14);
  expect_known_separations<f32>(4000, 1e-5, 7e-8);
}

// A jump turns a pair around, so the memory is that of another side. It may not make an overlap of what is apart.
template <class T>
void expect_lost_normals_are_given_up() {
  Random random(6);
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds) {
      const bool are_round =
          first >= ShapeKind::capsule && first != ShapeKind::ellipsoid;  // and have a form of their own
      if (second < first || are_round) continue;
      SCOPED_TRACE(std::string(to_string(first)) + " and " + to_string(second));
      double worst = 0.0;
      int deep = 0;
      for (int n = 0; n < 1000; ++n) {
        const Solid a = draw_solid(first, random), b = draw_solid(second, random);
        const Matrix3d turn = random.rotation();
        const Vector3d normal = random.direction();
        const double wanted = std::array{2e-3, 1e-2, 5e-2}[static_cast<std::size_t>(n % 3)];
        const Vector3d place = a.support(normal) + wanted * normal - turn * b.support(-(turn.transpose() * normal));
        Separating<T> pair(a, b);
        pair.remember(random.direction());
        Found found = pair.separate(turn, place, true);
        deep += found.separation < 0.0;
        for (int step = 0; step < 3; ++step) found = pair.separate(turn, place, true);
        worst = std::max(worst, std::abs(found.separation - wanted));
      }
      EXPECT_EQ(deep, 0);
      EXPECT_LT(worst, 1e-4);
    }
}

TEST(Convex, a_normal_of_another_side_is_given_up) {
  expect_lost_normals_are_given_up<f64>();
  expect_lost_normals_are_given_up<f32>();
}

constexpr double slack = 1e-5;

// Two solids as the kernels place them.
template <class T>
class Touching {
  using S = simd::ScalarOf<T>;

 public:
  Touching(const Solid& a, const Solid& b) : first_(a), second_(b) {
    numbers_.apart = S(1e-3), numbers_.size = static_cast<S>(a.size.norm() + b.size.norm());
    numbers_.slack = static_cast<S>(slack);
  }
  void touch(const kernels::PlacedShape<T>& a, const kernels::PlacedShape<T>& b, typename T::Mask kept, T margin,
             kernels::Patch<T>& patch) {
    kernels::touch_convex(first_.core, second_.core, a, b, numbers_, margin, ~T::none(), kept, memory_, patch);
  }
  Touch touch(const Shape& first, const Shape& second, bool kept = false) {
    kernels::PlacedShape<T> a, b;
    put(first, 0, a), put(second, 0, b);
    kernels::Patch<T> patch;
    touch(a, b, kept ? ~T::none() : T::none(), T(static_cast<S>(usual_margin)), patch);
    return get(patch, 4, 0);
  }

  Vector3d nearest_along() const {
    const simd::Vec3<T>& n = memory_.normal;
    return {n.x.lane(0), n.y.lane(0), n.z.lane(0)};
  }

 private:
  kernels::ConvexMemory<T> memory_;
  CoreOf<T> first_, second_;
  TouchingPair<S> numbers_{};
};

// A box on a box, turned about the vertical and hardly tilted, as boxes and as hulls.
TEST(Convex, boxes_rest_on_each_other_as_box_box_says) {
  Random random(3);
  for (int n = 0; n < 3000; ++n) {
    const Vector3d low = random.within(0.03, 0.1), high = random.within(0.02, 0.06);
    Shape first = box(low), second = box(high);
    second.rotation = about_z(random.between(-3, 3)) * random.rotation(1e-5);
    const double x = random.between(-0.03, 0.03), y = random.between(-0.03, 0.03);
    second.center = {x, y, low.z() + high.z() + random.between(-1e-4, 1e-4)};
    const Matrix3d all = random.rotation();
    first = first.moved(all, Vector3d(1, 2, 3)), second = second.moved(all, Vector3d(1, 2, 3));
    const Touch wanted = touch(first, second);
    const auto extent = [](const Touch& touch) {
      double most = 0.0;
      for (const Slot& p : touch.valid())
        for (const Slot& q : touch.valid()) most = std::max(most, (p.point - q.point).norm());
      return most;
    };
    for (const ShapeKind kind : {ShapeKind::box, ShapeKind::hull}) {
      Touching<f64> pair(cuboid(low, kind), cuboid(high, kind));
      for (const bool kept : {false, true}) {
        const Touch found = pair.touch(first, second, kept);
        EXPECT_NEAR(found.gap(), wanted.gap(), 2e-6);
        EXPECT_GT(found.normal.dot(wanted.normal), 1 - 1e-9);
        EXPECT_GE(found.valid().size() + 1, wanted.valid().size());
        EXPECT_GT(extent(found), 0.7 * extent(wanted));
        for (const Slot& slot : found.valid()) {
          EXPECT_LT((first.local(slot.point).cwiseAbs() - low).maxCoeff(), 1e-4);
          EXPECT_LT((second.local(slot.point).cwiseAbs() - high).maxCoeff(), 1e-4);
        }
      }
    }
  }
}

struct Laid {
  Shape first, second;
  Matrix3d turn;  // of the second, in the first's frame
  Vector3d place;
};

// The solids touch along a random normal; in two of three draws along a face of the first, in one of three face on
// face.
Laid lay(const Solid& a, const Solid& b, int draw, Random& random) {
  constexpr double gaps[] = {1e-3, -1e-5, 1e-5, -3e-4};
  const auto has_corners = [](const Solid& solid) { return solid.corners.cols() > 0; };
  Vector3d normal = random.direction();
  Laid laid{{}, {}, random.rotation(), {}};
  if (draw % 3 && has_corners(a)) normal = hull_of(a.corners).faces[0].normal;
  if (draw % 3 && a.kind == ShapeKind::cylinder) normal = Vector3d::UnitZ();
  if (draw % 3 == 2 && has_corners(b))
    laid.turn = shortest_turn(hull_of(b.corners).faces[1].normal, -normal).toRotationMatrix();
  if (draw % 3 == 2 && b.kind == ShapeKind::cylinder)
    laid.turn = shortest_turn(Vector3d::UnitZ(), normal).toRotationMatrix();
  const double gap = a.radius() + b.radius() + gaps[draw % 4];
  laid.place = a.support(normal) + gap * normal - laid.turn * b.support(-(laid.turn.transpose() * normal));
  laid.first.rotation = random.rotation(), laid.first.center = random.within(-1, 1);
  laid.first.size = a.size, laid.second.size = b.size;
  laid.second.rotation = laid.turn, laid.second.center = laid.place;
  laid.second = laid.second.moved(laid.first.rotation, laid.first.center);
  return laid;
}

void for_pairs(int poses, const std::function<void(const Solid&, const Solid&, const Laid&)>& check) {
  Random random(9);
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds) {
      if (second < first) continue;
      SCOPED_TRACE(std::string(to_string(first)) + " and " + to_string(second));
      for (int n = 0; n < poses && !testing::Test::HasFailure(); ++n) {
        const Solid a =
            n % 5 == 4 && first == ShapeKind::hull ? cuboid({0.03, 0.05, 0.04}, first) : draw_solid(first, random);
        const Solid b = draw_solid(second, random);
        check(a, b, lay(a, b, n, random));
      }
    }
}

// The least gap is the shapes' separation along the normal, and points are half way between the shapes. Where a face
// within 2 mrad is the normal's, the shape may reach deeper beside that face, and the separation is that of the nearest
// points. Slots stay where they are until another point is deeper by the slack.
template <class T>
void expect_own_gaps(double tolerance) {
  int many = 0;
  for_pairs(600, [&](const Solid& a, const Solid& b, const Laid& laid) {
    Touching<T> pair(a, b);
    const Touch found = pair.touch(laid.first, laid.second);
    const auto gap_along = [&](const Vector3d& n) {
      return separation_along(a, b, laid.turn, laid.place, n) - a.radius() - b.radius();
    };
    const Vector3d own = laid.first.rotation.transpose() * found.normal, nearest = pair.nearest_along();
    EXPECT_GE(found.gap(), gap_along(own) - tolerance);
    EXPECT_LE(found.gap(),
              std::max(gap_along(own), gap_along(nearest)) + tolerance + (found.valid().size() < 2 ? 0.0 : slack));
    EXPECT_GT(own.dot(nearest), 1.0 - 2.5e-6);
    for (const Slot& slot : found.valid()) {
      const double above_first =
          found.normal.dot(slot.point - laid.first.center) - own.dot(a.support(own)) - a.radius();
      EXPECT_LT(above_first, 0.5 * slot.gap + tolerance);
    }
    many += found.valid().size() > 1;
  });
  EXPECT_GT(many, 1000);  // flat contacts are among them
}

TEST(Convex, the_least_gap_is_the_separation_along_the_normal) {
  expect_own_gaps<f64>(2e-6);  // a corner may be a millionth of the size beside a face that leans
  expect_own_gaps<f32>(2e-6);
}

// Memory too: a step that begins where the other has ended stays in its lane.
TEST(Convex, has_the_same_bits_alone_and_beside_other_poses) {
  constexpr int lanes = f32x4::lanes;
  const auto same = [](const Vector3d& a, const Vector3d& b) { return std::memcmp(&a, &b, sizeof a) == 0; };
  Random random(21);
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds) {
      if (second < first) continue;
      const Solid a = draw_solid(first, random), b = draw_solid(second, random);
      Touching<f32x4> beside(a, b);
      std::vector<std::unique_ptr<Touching<f32>>> alone;
      for (int l = 0; l < lanes; ++l) alone.push_back(std::make_unique<Touching<f32>>(a, b));
      for (int n = 0; n < 100; ++n) {
        const bool kept = n % 2 == 1;
        kernels::PlacedShape<f32x4> wide_a, wide_b;
        std::vector<Laid> laid;
        for (int l = 0; l < lanes; ++l) {
          laid.push_back(lay(a, b, n + l, random));
          put(laid.back().first, l, wide_a), put(laid.back().second, l, wide_b);
        }
        kernels::Patch<f32x4> patch;
        beside.touch(wide_a, wide_b, kept ? ~f32x4::none() : f32x4::none(), f32x4(static_cast<float>(usual_margin)),
                     patch);
        for (int l = 0; l < lanes; ++l) {
          const Touch one = get(patch, 4, l),
                      other = alone[static_cast<std::size_t>(l)]->touch(laid[static_cast<std::size_t>(l)].first,
                                                                        laid[static_cast<std::size_t>(l)].second, kept);
          EXPECT_TRUE(same(one.normal, other.normal) && same(one.tangent, other.tangent));
          for (std::size_t s = 0; s < 4; ++s) {
            ASSERT_EQ(one.slots[s].valid, other.slots[s].valid);
            if (!one.slots[s].valid) continue;
            EXPECT_TRUE(same(one.slots[s].point, other.slots[s].point));
            EXPECT_EQ(one.slots[s].gap, other.slots[s].gap);
            EXPECT_EQ(one.slots[s].face, other.slots[s].face);
          }
        }
      }
    }
}

// Hulls turn about each other by 2 mrad a step, pressed: the normal must turn and not jump.
TEST(Convex, the_normal_follows_a_slow_turn) {
  Random random(31);
  for (int n = 0; n < 20; ++n) {
    const Solid a = draw_solid(n % 2 ? ShapeKind::hull : ShapeKind::cylinder, random),
                b = draw_solid(ShapeKind::hull, random);
    Separating<f32> pair(a, b);
    const Vector3d axis = random.direction();
    Matrix3d turn = random.rotation();
    Vector3d normal = random.direction();
    for (int step = 0; step < 1500; ++step) {
      const Vector3d place = a.support(normal) - 2e-4 * normal - turn * b.support(-(turn.transpose() * normal));
      const Found found = pair.separate(turn, place, step > 0);
      EXPECT_GE(found.separation, separation_along(a, b, turn, place, normal) - 1e-6) << "worse than the last normal";
      if (step > 20) {
        EXPECT_LT(std::acos(std::min(1.0, found.normal.dot(normal))), 0.6);
      }
      normal = found.normal;
      turn = Eigen::AngleAxisd(0.002, axis).toRotationMatrix() * turn;
    }
  }
}

TEST(Convex, is_finite_where_no_direction_is_given) {
  Random random(13);
  for (const ShapeKind first : kinds)
    for (const ShapeKind second : kinds) {
      if (second < first) continue;
      SCOPED_TRACE(std::string(to_string(first)) + " and " + to_string(second));
      const Solid a = draw_solid(first, random), b = draw_solid(second, random);
      for (const Vector3d& place : {Vector3d(0, 0, 0), Vector3d(1e-12, 0, -1e-11), Vector3d(0, 0, 0.01)})
        for (const Matrix3d& turn : {Matrix3d(Matrix3d::Identity()), random.rotation()}) {
          Shape one, other;
          one.size = a.size, other.size = b.size, other.center = place, other.rotation = turn;
          const Touch found = Touching<f32>(a, b).touch(one, other);
          EXPECT_NEAR(found.normal.norm(), 1.0, 1e-5);
          ASSERT_FALSE(found.valid().empty());
          EXPECT_LT(found.gap(), -0.5 * 0.02);
          for (const Slot& slot : found.valid()) EXPECT_TRUE(slot.point.allFinite());
        }
    }
}

// --- on a half-space -----------------------------------------------------------------------------------

template <class T>
Touch on_half_space(const Solid& solid, const Shape& plane, const Shape& placed) {
  kernels::PlacedShape<T> a, b;
  put(plane, 0, a), put(placed, 0, b);
  kernels::Patch<T> patch;
  const T margin(static_cast<simd::ScalarOf<T>>(usual_margin));
  const CoreOf<T> core(solid);
  switch (solid.kind) {
    case ShapeKind::cylinder: kernels::half_space_cylinder(a, b, margin, patch); break;
    case ShapeKind::ellipsoid: kernels::half_space_ellipsoid(a, b, margin, patch); break;
    default: kernels::half_space_hull(a, core.core, b, T(0), patch);
  }
  return get(patch, solid.kind == ShapeKind::ellipsoid ? 1 : 4, 0);
}

// In any pose: the lowest point is among the slots, all of which are on the surface, half their gap above the plane.
template <class T>
void expect_lowest(double tolerance) {
  Random random(7);
  for (const ShapeKind kind : {ShapeKind::cylinder, ShapeKind::ellipsoid, ShapeKind::hull})
    for (int n = 0; n < 3000; ++n) {
      SCOPED_TRACE(to_string(kind));
      const Solid solid = draw_solid(kind, random);
      Shape plane, placed;
      plane.rotation = random.rotation(), plane.center = random.within(-1, 1);
      placed.size = solid.size, placed.center = plane.center + random.within(-0.1, 0.1);
      placed.rotation = random.rotation();
      const Vector3d normal = plane.rotation.col(2), down = -(placed.rotation.transpose() * normal);
      const double lowest = normal.dot(placed.world(solid.support(down)) - plane.center);
      const Touch found = on_half_space<T>(solid, plane, placed);
      // One that is nearly upright has a point of its rim towards its own x.
      const double tilt = std::hypot(down.x(), down.y());
      const double off = kind == ShapeKind::cylinder && tilt < 0.05 ? std::min(M_PI / 4, 1e-3 / tilt) : 0.0;
      EXPECT_NEAR(found.gap(), lowest, tolerance + solid.size[0] * tilt * (1.0 - std::cos(off)));
      for (const Slot& slot : found.valid()) {
        EXPECT_NEAR(normal.dot(slot.point - plane.center), 0.5 * slot.gap, tolerance);
        const Vector3d surface = placed.local(slot.point + 0.5 * slot.gap * normal);
        if (kind == ShapeKind::cylinder) {
          EXPECT_NEAR(surface.head<2>().norm(), solid.size[0], tolerance);
          EXPECT_NEAR(std::abs(surface.z()), solid.size[1], tolerance);
        } else if (kind == ShapeKind::ellipsoid) {
          EXPECT_NEAR(surface.cwiseQuotient(solid.size).norm(), 1.0, 100 * tolerance);
        } else {
          EXPECT_LT((solid.corners.colwise() - surface).colwise().norm().minCoeff(), tolerance);
        }
      }
    }
}

TEST(OnHalfSpace, the_lowest_point_is_a_slot) {
  expect_lowest<f64>(1e-12);
  expect_lowest<f32>(1e-6);
}

// Slots of one that lies or stands hold it: the middle is between them.
TEST(OnHalfSpace, cylinders_stand_on_four_points_and_lie_on_two) {
  const Solid solid{ShapeKind::cylinder, {0.04, 0.05, 0.0}};
  Random random(8);
  for (int n = 0; n < 300; ++n) {
    const bool lies = n % 2 == 0;
    Shape plane = half_space(), placed;
    placed.size = solid.size;
    placed.rotation = about_z(random.between(-3, 3)) *
                      Eigen::AngleAxisd(lies ? M_PI / 2 : 0.0, Vector3d::UnitX()).toRotationMatrix() *
                      about_z(random.between(-3, 3)) * random.rotation(1e-6);
    const Touch found = on_half_space<f32>(solid, plane, placed);
    ASSERT_EQ(found.valid().size(), lies ? 2U : 4U);
    Vector3d mean = Vector3d::Zero();
    for (const Slot& slot : found.valid()) mean += slot.point / static_cast<double>(found.valid().size());
    EXPECT_LT(mean.head<2>().norm(), 1e-6);  // a lying one must not roll by itself
    for (const Slot& slot : found.valid()) EXPECT_NEAR((slot.point - mean).head<2>().norm(), lies ? 0.05 : 0.04, 1e-6);
  }
}

}  // namespace
}  // namespace lockstep::contacts_test
