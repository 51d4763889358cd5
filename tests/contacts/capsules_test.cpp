// Capsules that lie on something or cross it, and spheres inside a box. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "searches.h"

namespace lockstep::contacts_test {
namespace {

void expect_ends(const Touch& found, const Shape& capsule, const Vector2d& part, const Vector3d& to_slot) {
  ASSERT_EQ(found.valid().size(), 2U);
  for (int end = 0; end < 2; ++end)
    EXPECT_LT((capsule.center + part[end] * capsule.axis(2) + to_slot - found.slots[end].point).norm(), 1e-9);
}

TEST(ParallelCapsules, touch_at_the_ends_of_the_part_where_they_lie_side_by_side) {
  Random random(11);
  for (int n = 0; n < 500; ++n) {
    Scene scene{random.shape(Form::capsule), random.shape(Form::capsule)};
    const double radii = scene.first.radius() + scene.second.radius(), gap = random.between(-0.003, 0.002);
    const double angle = random.between(-M_PI, M_PI);
    const Vector3d to(std::cos(angle), std::sin(angle), 0.0);
    scene.second = scene.second.at((radii + gap) * to + random.between(-0.15, 0.15) * Vector3d::UnitZ());
    if (n % 2 == 0) scene.second.rotation = Eigen::AngleAxisd(M_PI, to).toRotationMatrix();
    const Matrix3d turn = random.rotation();
    const Vector3d way = random.within(-1.0, 1.0);
    const Shape first = scene.first.moved(turn, way), second = scene.second.moved(turn, way);
    const auto beside = [&](double t) {
      return std::abs(second.local(first.center + t * first.axis(2)).z()) <= second.size[1];
    };
    const Vector2d part = part_where(first.size[1], beside);
    if (part[1] - part[0] < 0.01 * first.size[1]) continue;
    const Touch found = touch(first, second);
    EXPECT_LT((found.normal - turn * to).norm(), 1e-12);
    for (const Slot& slot : found.slots) EXPECT_NEAR(slot.gap, gap, 1e-12);
    expect_ends(found, first, part, (first.radius() + 0.5 * gap) * (turn * to));
  }
}

// A capsule on a face. Two thirds of the boxes are not turned, so that the capsule's axis has no share along the
// normal, not even by rounding. Then all the part above the face is equally near, which gave a wrong point once.
TEST(BoxAndCapsule, touch_at_the_ends_of_the_part_that_lies_on_a_face) {
  Random random(12);
  int across_the_face = 0;
  for (int n = 0; n < 1500; ++n) {
    const Shape box = random.shape(Form::box);
    Shape rod = random.shape(Form::capsule);
    const double gap = random.between(-0.003, 0.002);
    const double yaw = n % 3 == 0 ? random.below(4) * M_PI / 2 : random.between(-M_PI, M_PI);
    rod.rotation << 0.0, -std::sin(yaw), std::cos(yaw), 0.0, std::cos(yaw), std::sin(yaw), -1.0, 0.0, 0.0;
    rod.center = random.within(-1.0, 1.0).cwiseProduct(box.size);
    rod.center.z() = box.size.z() + rod.radius() + gap;
    const Matrix3d turn = n % 3 == 2 ? random.rotation() : Matrix3d(Matrix3d::Identity());
    const Vector3d way = n % 3 == 2 ? random.within(-1.0, 1.0) : Vector3d(Vector3d::Zero());
    const Shape first = box.moved(turn, way), second = rod.moved(turn, way);
    const auto above = [&](double t) {
      const Vector3d p = first.local(second.center + t * second.axis(2)).cwiseAbs() - first.size;
      return p.x() <= 0.0 && p.y() <= 0.0;
    };
    const Vector2d part = part_where(second.size[1], above);
    across_the_face += part[0] > -second.size[1] && part[1] < second.size[1];
    const Touch found = touch(first, second), in_float = touch<f32>(first, second);
    EXPECT_LT((found.normal - turn.col(2)).norm(), 1e-12);
    for (const Slot& slot : found.slots) EXPECT_NEAR(slot.gap, gap, 1e-12);
    expect_ends(found, second, part, -(second.radius() + 0.5 * gap) * turn.col(2));
    for (const Slot& slot : in_float.slots) EXPECT_NEAR(slot.gap, gap, 1e-6);
  }
  EXPECT_GT(across_the_face, 100);
}

// Capsules count as parallel up to an angle of 0.01. Their gaps are along the normal of the middle, so they leave out
// what the axes are apart across it, 0.01 L at the ends. With it the distance d would be longer by (0.01 L)^2 / 2 d.
// And the normal may lean by 0.01, which is 1e-4 d.
TEST(NearlyParallelCapsules, are_deeper_than_the_truth_by_little) {
  Random random(16);
  double deepest = 0.0;
  for (int n = 0; n < 150; ++n) {
    const Shape first = random.shape(Form::capsule);
    Shape second = random.shape(Form::capsule).turned(random.rotation(0.0099));
    const double angle = random.between(-M_PI, M_PI), radii = first.radius() + second.radius();
    second.center = radii * Vector3d(std::cos(angle), std::sin(angle), 0.0);
    second.center.z() = random.between(-0.1, 0.1);
    const double truth = separation(first, second), gap = touch(first, second).gap();
    const double shorter = std::min(first.size[1], second.size[1]);
    EXPECT_LT(gap - truth, 1e-11);
    EXPECT_LT(truth - gap, 1e-4 * (shorter * shorter / (2.0 * radii) + radii));
    deepest = std::max(deepest, truth - gap);
  }
  EXPECT_GT(deepest, 1e-6);  // the bound is about something
}

// The way out for an axis that passes through the box, by its ends.
TEST(BoxAndCapsule, whose_axis_is_inside_part_through_the_face_that_takes_least) {
  Random random(17);
  for (int n = 0; n < 500; ++n) {
    const Shape first = random.shape(Form::box).turned(random.rotation()).at(random.within(-1.0, 1.0));
    Shape second = random.shape(Form::capsule).turned(random.rotation());
    second.center = first.world(random.within(-0.9, 0.9).cwiseProduct(first.size));
    const Vector3d half = second.size[1] * second.axis(2);
    const Vector3d one = first.local(second.center + half), other = first.local(second.center - half);
    double least = INFINITY;
    Vector3d way = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      for (const double side : {-1.0, 1.0}) {
        const double needed = first.size[k] - std::min(side * one[k], side * other[k]);
        if (needed < least) least = needed, way = side * first.axis(k);
      }
    const Touch found = touch(first, second);
    EXPECT_LT((found.normal - way).norm(), 1e-12);
    EXPECT_LT(found.gap(), -second.radius());
    EXPECT_GT(found.gap(), -second.radius() - least - 1e-12);
  }
}

TEST(BoxAndSphere, whose_centre_is_inside_part_through_the_nearest_face) {
  Random random(14);
  for (int n = 0; n < 300; ++n) {
    const Shape first = random.shape(Form::box).turned(random.rotation()).at(random.within(-1.0, 1.0));
    const Shape second =
        random.shape(Form::sphere).at(first.world(random.within(-0.99, 0.99).cwiseProduct(first.size)));
    const Touch found = touch(first, second);
    const double nearest = (first.size - first.local(second.center).cwiseAbs()).minCoeff();
    EXPECT_NEAR(found.gap(), -nearest - second.radius(), 1e-12);
    const Shape outside = second.at(second.center - found.gap() * found.normal);
    EXPECT_NEAR(separation(first, outside), 0.0, 1e-11);
  }
}

// Capsules with axes that nearly cross still part along both axes' common normal.
TEST(CrossedCapsules, part_across_both_axes) {
  Random random(15);
  for (int n = 0; n < 300; ++n) {
    const Shape first = random.shape(Form::capsule).turned(random.rotation());
    Shape second = random.shape(Form::capsule).turned(random.rotation());
    const Vector3d across = first.axis(2).cross(second.axis(2));
    if (across.norm() < 0.2) continue;
    const double depth = 1e-6;
    const Vector3d along = random.within(-0.5, 0.5);
    second.center = first.center + along.x() * first.size[1] * first.axis(2) +
                    along.y() * second.size[1] * second.axis(2) + depth * across.normalized();
    const Touch found = touch(first, second);
    EXPECT_LT((found.normal - across.normalized()).norm(), 1e-8);
    EXPECT_NEAR(found.gap(), depth - first.radius() - second.radius(), 1e-12);
  }
}

}  // namespace
}  // namespace lockstep::contacts_test
