// Every pair of shapes finds where they touch. SPDX-License-Identifier: Apache-2.0
//
// Here is what holds for all pairs. capsules_test.cpp and box_box_test.cpp have what is special to them.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <string>

#include "searches.h"

namespace lockstep::contacts_test {
namespace {

// Calls check(scene) for many scenes of each kind.
void for_scenes(int count, const std::function<void(const Scene&)>& check) {
  for (const PairKind kind : all_kinds) {
    SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)));
    Random random(static_cast<std::uint64_t>(kind) + 1);
    for (int n = 0; n < count && !testing::Test::HasFailure(); ++n) {
      SCOPED_TRACE("scene " + std::to_string(n));
      check(touching_lightly(kind, random));
    }
  }
}

// --- what holds for all pairs ------------------------------------------------------------------------

template <class T>
void expect_frame(const Scene& scene, double tolerance) {
  const Touch found = touch<T>(scene.first, scene.second);
  Matrix3d frame;
  frame << found.normal, found.tangent, found.other_tangent;
  EXPECT_LT((frame.transpose() * frame - Matrix3d::Identity()).norm(), tolerance);
  EXPECT_NEAR(frame.determinant(), 1.0, tolerance);
  EXPECT_GT(found.normal.dot(scene.second.center - scene.first.center), 0.0);
}

TEST(Patches, have_a_right_handed_frame_whose_normal_points_to_the_second_shape) {
  for_scenes(500, [](const Scene& scene) {
    expect_frame<f64>(scene, 1e-14);
    expect_frame<f32>(scene, 2e-6);
  });
}

// A box takes what is nearly above a face, by a cosine of 1 - 1e-6, for a point above that face.
constexpr double snapped = 1e-6;

TEST(Patches, have_the_separation_as_their_smallest_gap) {
  for_scenes(100, [](const Scene& scene) {
    if (kind_of(scene.first, scene.second) == PairKind::box_box) return;
    const bool snaps = kind_of(scene.first, scene.second) == PairKind::box_capsule;
    const double truth = separation(scene.first, scene.second);
    EXPECT_NEAR(touch(scene.first, scene.second).gap(), truth, 1e-11 + (snaps ? snapped * scene.second.radius() : 0.0));
    EXPECT_NEAR(touch<f32>(scene.first, scene.second).gap(), truth, 5e-7);
  });
}

bool are_edges_apart(const Scene& scene, const Touch& found) {
  return kind_of(scene.first, scene.second) == PairKind::box_box && is_of_edges(found.slots[0]) && found.gap() > 0.0;
}

// Half the gap from a slot's point along the normal there is the surface of the first shape one way and of the second
// the other way. A capsule's surface is that of the sphere about a point of its axis: a second slot may be an end that
// is not the nearest. Edges of boxes that are apart may pass each other beyond their ends.
void expect_on_surface(const Shape& shape, const Vector3d& p, const Vector3d& outwards, double tolerance) {
  if (shape.form == Form::half_space) {
    EXPECT_NEAR(shape.local(p).z(), 0.0, tolerance);
  } else if (shape.form == Form::box) {
    EXPECT_NEAR((shape.local(p).cwiseAbs() - shape.size).maxCoeff(), 0.0, tolerance);
  } else {
    EXPECT_LT(distance_from_core(shape, p - shape.radius() * outwards), tolerance);
  }
}

TEST(Patches, have_points_in_the_middle_of_the_gap) {
  for_scenes(300, [](const Scene& scene) {
    const bool snaps = kind_of(scene.first, scene.second) == PairKind::box_capsule;
    const double tolerance = 1e-11 + (snaps ? std::sqrt(2.0 * snapped) * scene.second.radius() : 0.0);
    const Touch found = touch(scene.first, scene.second);
    for (const Slot& slot : found.valid()) {
      if (are_edges_apart(scene, found)) continue;
      expect_on_surface(scene.first, slot.point - 0.5 * slot.gap * found.normal, found.normal, tolerance);
      expect_on_surface(scene.second, slot.point + 0.5 * slot.gap * found.normal, -found.normal, tolerance);
    }
  });
}

// Each slot of one is somewhere among the slots of the other, whose points `place` moves.
void expect_same_slots(const Touch& one, const Touch& other, const std::function<Vector3d(const Vector3d&)>& place) {
  EXPECT_EQ(one.valid().size(), other.valid().size());
  for (const Slot& slot : one.valid()) {
    double nearest = INFINITY;
    for (const Slot& candidate : other.valid())
      nearest = std::min(nearest, (place(candidate.point) - slot.point).norm() + std::abs(candidate.gap - slot.gap));
    EXPECT_LT(nearest, 1e-11);
  }
}

TEST(Patches, are_the_same_in_a_mirror) {
  const Matrix3d mirror = Vector3d(-1.0, 1.0, 1.0).asDiagonal();
  const auto mirrored = [&](const Shape& shape) {  // x of its own frame points the other way as well
    return Shape{shape.form, shape.size, mirror * shape.center, mirror * shape.rotation * mirror};
  };
  for_scenes(300, [&](const Scene& scene) {
    const Touch one = touch(scene.first, scene.second), other = touch(mirrored(scene.first), mirrored(scene.second));
    EXPECT_LT((mirror * one.normal - other.normal).norm(), 1e-12);
    expect_same_slots(one, other, [&](const Vector3d& p) { return Vector3d(mirror * p); });
  });
}

// Two boxes prefer faces of the first one. Where the other order chooses another axis, nothing is compared.
TEST(Patches, are_reversed_where_the_shapes_are_exchanged) {
  int other_axis = 0;
  for_scenes(300, [&](const Scene& scene) {
    if (scene.first.form != scene.second.form) return;
    const Touch one = touch(scene.first, scene.second), other = touch(scene.second, scene.first);
    if (scene.first.form == Form::box && (one.normal + other.normal).norm() > 1e-9) {
      ++other_axis;
      return;
    }
    EXPECT_LT((one.normal + other.normal).norm(), 1e-12);
    if (!are_edges_apart(scene, one)) expect_same_slots(one, other, [](const Vector3d& p) { return p; });
  });
  EXPECT_LT(other_axis, 6);  // of 300; 0 when written
}

// The memory of friction is in the frame of the contact, and belongs to a slot and its face. So a pair that moves as
// one rigid body must keep both, also where two axes are equally across the normal or two corners equally far.
template <class T>
void expect_slots_to_stay(const Scene& scene, double tolerance) {
  const Touch still = touch<T>(scene.first, scene.second);
  Random random(5);
  for (int n = 0; n < 200; ++n) {
    const Matrix3d turn = random.rotation();
    const Vector3d way = random.within(-1.0, 1.0);
    const Touch moved = touch<T>(scene.first.moved(turn, way), scene.second.moved(turn, way));
    EXPECT_LT((turn.transpose() * moved.normal - still.normal).norm(), 1e-2 * std::sqrt(tolerance));
    EXPECT_LT((turn.transpose() * moved.tangent - still.tangent).norm(), 1e-2 * std::sqrt(tolerance));
    for (std::size_t s = 0; s < still.slots.size(); ++s) {
      ASSERT_EQ(moved.slots[s].valid, still.slots[s].valid) << "slot " << s;
      if (!still.slots[s].valid) continue;
      EXPECT_EQ(moved.slots[s].face, still.slots[s].face);
      EXPECT_LT((turn * still.slots[s].point + way - moved.slots[s].point).norm(), tolerance);
    }
  }
}

TEST(Patches, keep_slots_and_tangents_while_both_shapes_move_as_one) {
  const Shape cube = box({0.1, 0.1, 0.1}), slab = box({0.1, 0.08, 0.02}), beam = box({0.1, 0.02, 0.02});
  const Shape rod = capsule(0.02, 0.05), ball = sphere(0.02);
  const Matrix3d lying = Eigen::AngleAxisd(M_PI / 2, Vector3d(std::cos(0.3), std::sin(0.3), 0.0)).toRotationMatrix();
  const double on_cube = 0.12 - 1e-4, on_slab = 0.04 - 1e-4;
  const std::vector<Scene> scenes = {{cube, rod.turned(lying).at({0.0, 0.0, on_cube})},
                                     {cube, ball.at({0.01, 0.02, on_cube})},
                                     {sphere(0.1), ball.at({0.0, 0.0, on_cube})},
                                     {rod, rod.at({0.04 - 1e-4, 0.0, 0.01})},
                                     {rod, ball.at({0.0, 0.04 - 1e-4, 0.0})},
                                     {rod, ball.at({0.0, 0.0, 0.09 - 1e-4})},
                                     {half_space(), slab.at({0.3, 0.0, 0.02})},
                                     {cube, cube.at({0.01, 0.02, 0.2 - 1e-4})},
                                     {cube, cube.at({0.0, 0.0, 0.2 - 1e-4})},
                                     {slab, slab.at({0.0, 0.0, on_slab}).turned(about_z(M_PI / 2))},
                                     {cube, cube.at({0.0, 0.0, 0.2 - 1e-4}).turned(about_z(M_PI / 4))},
                                     {slab, slab.at({0.02, 0.01, on_slab}).turned(about_z(0.6))},
                                     {slab, slab.at({-0.03, 0.04, on_slab}).turned(about_z(2.1))},
                                     {beam, beam.at({0.0, 0.0, on_slab}).turned(about_z(0.5))}};
  for (std::size_t n = 0; n < scenes.size(); ++n) {
    SCOPED_TRACE("scene " + std::to_string(n));
    expect_slots_to_stay<f64>(scenes[n], 1e-12);
    expect_slots_to_stay<f32>(scenes[n], 1e-6);
  }
}

// The lowest corner is on three faces. The slots are on the one that looks most at the plane, or a box would not lie.
TEST(HalfSpaceAndBox, touch_at_the_four_lowest_corners_of_a_box_that_lies) {
  Random random(12);
  for (int n = 0; n < 300; ++n) {
    Shape second = box(random.within(0.02, 0.1));
    const int axis = random.below(3), quarter_turns = random.below(4);
    second.rotation = Eigen::AngleAxisd(quarter_turns * M_PI / 2, Vector3d::Unit(axis)).toRotationMatrix();
    second.rotation = random.rotation(0.05) * second.rotation;
    second.rotation = about_z(random.between(-M_PI, M_PI)) * second.rotation;
    const Touch found = touch(half_space(), second);
    std::vector<double> heights, gaps;
    for (const Vector3d& corner : corners(second)) heights.push_back(corner.z());
    for (const Slot& slot : found.valid()) gaps.push_back(slot.gap);
    std::sort(heights.begin(), heights.end()), std::sort(gaps.begin(), gaps.end());
    ASSERT_EQ(gaps.size(), 4U);
    for (std::size_t s = 0; s < 4; ++s) EXPECT_NEAR(gaps[s], heights[s], 1e-12);
  }
}

// --- degenerate poses --------------------------------------------------------------------------------

template <class T>
void expect_finite(const Scene& scene) {
  const Touch found = touch<T>(scene.first, scene.second);
  EXPECT_NEAR(found.normal.norm(), 1.0, 1e-6);
  EXPECT_NEAR(found.tangent.norm(), 1.0, 1e-6);
  EXPECT_NEAR(found.other_tangent.norm(), 1.0, 1e-6);
  EXPECT_NEAR(found.normal.dot(found.tangent), 0.0, 1e-6);
  EXPECT_FALSE(found.valid().empty());
  EXPECT_LE(found.gap(), -scene.first.radius() - scene.second.radius() + 1e-6);
  for (const Slot& slot : found.slots) EXPECT_TRUE(slot.point.allFinite() && std::isfinite(slot.gap));
}

// The centre or axis of one is in the other, so there may be no direction between them.
TEST(Patches, are_finite_where_no_direction_is_given) {
  const Shape cube = box({0.1, 0.1, 0.1}), rod = capsule(0.02, 0.2), ball = sphere(0.03), dot = capsule(0.02, 0.0);
  const Matrix3d tilted = Eigen::AngleAxisd(0.7, Vector3d(1.0, 2.0, 3.0).normalized()).toRotationMatrix();
  std::vector<Scene> scenes;
  for (const Shape& first : {cube, rod, ball, dot})
    for (const Shape& second : {cube, rod, ball, dot})
      for (const Matrix3d& turn : {Matrix3d(Matrix3d::Identity()), tilted}) {
        if (first.form > second.form) continue;
        scenes.push_back({first, second.turned(turn)});                           // centres coincide
        scenes.push_back({first.turned(turn), second.at({0.0, 1e-12, -1e-11})});  // almost
        if (first.form == Form::sphere || first.size.y() == 0.0) continue;
        scenes.push_back({first, second.turned(turn).at({0.0, 0.0, 0.02})});  // along an axis
      }
  for (const Shape& second : {cube, rod, ball, dot}) scenes.push_back({half_space(), second.turned(tilted)});
  scenes.push_back({cube, rod.at({0.02, -0.03, 0.05}).turned(tilted)});  // the axis passes through the box
  scenes.push_back({cube, rod.at({0.1, 0.0, 0.0})});                     // in a face
  scenes.push_back({cube, rod.at({0.1, 0.1, 0.0})});                     // along an edge
  scenes.push_back({cube, ball.at({0.1, 0.1, 0.1})});                    // at a corner
  scenes.push_back({cube, ball.at({0.05, 0.05, 0.0})});                  // equally far from two faces
  Random random(13);
  for (std::size_t n = 0; n < scenes.size(); ++n)
    for (int pose = 0; pose < 20; ++pose) {
      SCOPED_TRACE("scene " + std::to_string(n) + ", pose " + std::to_string(pose));
      const Matrix3d turn = pose == 0 ? Matrix3d(Matrix3d::Identity()) : random.rotation();
      const Scene moved{scenes[n].first.moved(turn, 0.1 * random.direction()), scenes[n].second};
      const Vector3d way = moved.first.center - turn * scenes[n].first.center;
      expect_finite<f64>({moved.first, scenes[n].second.moved(turn, way)});
      expect_finite<f32>({moved.first, scenes[n].second.moved(turn, way)});
    }
}

// --- precision and lanes -----------------------------------------------------------------------------

// The double precision gets the numbers that single precision can hold, so only the arithmetic differs.
TEST(Patches, are_the_same_in_single_precision) {
  const auto rounded = [](const Shape& shape) {
    return Shape{shape.form, shape.size.cast<float>().cast<double>(), shape.center.cast<float>().cast<double>(),
                 shape.rotation.cast<float>().cast<double>()};
  };
  for_scenes(500, [&](const Scene& scene) {
    const Shape first = rounded(scene.first), second = rounded(scene.second);
    // Where axes of capsules are nearly parallel, the point slides along them at the least change.
    if (first.form == Form::capsule && second.form == Form::capsule)
      if (first.axis(2).cross(second.axis(2)).norm() < 0.2) return;
    const Touch exact = touch(first, second), found = touch<f32>(first, second);
    EXPECT_LT((exact.normal - found.normal).norm(), 2e-5);
    for (std::size_t s = 0; s < exact.slots.size(); ++s) {
      ASSERT_EQ(exact.slots[s].valid, found.slots[s].valid);
      if (!exact.slots[s].valid) continue;
      EXPECT_EQ(exact.slots[s].face, found.slots[s].face);
      EXPECT_NEAR(exact.slots[s].gap, found.slots[s].gap, 3e-7);
      EXPECT_LT((exact.slots[s].point - found.slots[s].point).norm(), 1e-6);
    }
  });
}

TEST(Patches, have_the_same_bits_alone_and_beside_other_poses) {
  constexpr int lanes = f32x4::lanes;
  for (const PairKind kind : all_kinds) {
    Random random(21);
    std::vector<Scene> scenes;
    for (int n = 0; n < 200; ++n) scenes.push_back(touching_lightly(kind, random));
    for (std::size_t n = 0; n + lanes <= scenes.size(); ++n) {  // each scene is in each lane once
      kernels::PlacedShape<f32x4> first, second;
      for (int l = 0; l < lanes; ++l)
        put(scenes[n + static_cast<std::size_t>(l)].first, l, first),
            put(scenes[n + static_cast<std::size_t>(l)].second, l, second);
      kernels::Patch<f32x4> patch;
      touch_wide(kind, first, second, f32x4(static_cast<float>(usual_margin)), patch);
      for (int l = 0; l < lanes; ++l) {
        const Scene& scene = scenes[n + static_cast<std::size_t>(l)];
        const Touch beside = get(patch, slots_of(kind), l), alone = touch<f32>(scene.first, scene.second);
        const auto same = [](const Vector3d& a, const Vector3d& b) { return std::memcmp(&a, &b, sizeof a) == 0; };
        EXPECT_TRUE(same(beside.normal, alone.normal) && same(beside.tangent, alone.tangent) &&
                    same(beside.other_tangent, alone.other_tangent));
        for (std::size_t s = 0; s < alone.slots.size(); ++s) {
          const Slot &one = beside.slots[s], &other = alone.slots[s];
          EXPECT_TRUE(same(one.point, other.point) && std::memcmp(&one.gap, &other.gap, sizeof one.gap) == 0);
          EXPECT_TRUE(one.face == other.face && one.valid == other.valid);
        }
      }
    }
  }
}

}  // namespace
}  // namespace lockstep::contacts_test
