// Blocks and balls on a plane, against theory. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

template <class S>
struct Blocks : testing::Test {
  static constexpr bool is_double = sizeof(S) == 8;
};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Blocks, Precisions);

template <class S>
Batch<S> batch_of(const Model& model, double dt = 1.0 / 240, Integrator integrator = Integrator::automatic) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator;
  return Batch<S>(compile(model, settings), 3, {.threads = 1});
}

// Row of the first environment's root pose or velocity.
template <class S>
double pose(const Batch<S>& batch, int row) {
  return static_cast<double>(batch.root_poses()(row, 0));
}
template <class S>
double velocity(const Batch<S>& batch, int row) {
  return static_cast<double>(batch.root_velocities()(row, 0));
}

TYPED_TEST(Blocks, a_block_rests_on_a_slope_just_below_the_friction_angle) {
  Batch<TypeParam> batch = batch_of<TypeParam>(slope(0.99));
  batch.step(240);
  const double start = pose(batch, 0);
  batch.step(960);
  EXPECT_LT(std::abs(pose(batch, 0) - start), this->is_double ? 1e-9 : 1e-6);
  EXPECT_EQ(batch.faults()[0], Fault::none);
}

TYPED_TEST(Blocks, a_block_slides_down_a_slope_just_above_the_friction_angle) {
  Batch<TypeParam> batch = batch_of<TypeParam>(slope(1.01));
  batch.step(1200);
  const double angle = 1.01 * std::atan(0.5), speed = 9.81 * (std::sin(angle) - 0.5 * std::cos(angle)) * 5.0;
  EXPECT_NEAR(velocity(batch, 3), speed, 0.003 * speed);
}

TYPED_TEST(Blocks, euler_slides_on_the_plane_and_stops_in_the_distance_of_coulomb_friction) {
  double last = 0.0;
  for (const int hertz : {120, 240, 480}) {
    Model model = block();
    model.roots[0].velocity << 0, 0, 0, 3, 0, 0;
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / hertz, Integrator::euler);
    double highest = -1.0, lowest = 1.0;
    for (int i = 0; i < 2 * hertz; ++i) {
      batch.step(1);
      highest = std::max(highest, pose(batch, 2) - 0.05), lowest = std::min(lowest, pose(batch, 2) - 0.05);
    }
    EXPECT_LT(highest, 1e-6);
    EXPECT_GT(lowest, -1e-4);
    const double way = 9.0 / (2 * 0.5 * 9.81), error = std::abs(pose(batch, 0) - way);
    EXPECT_LT(error, 0.03 * way * 120 / hertz);  // 1.5 % at 240 Hz, of first order
    if (hertz > 120) {
      EXPECT_NEAR(last / error, 2.0, 0.2);
    }
    last = error;
  }
}

// The reference is the step of 1/3840 s: the pressure under a turning block has no solution in closed form.
TYPED_TEST(Blocks, euler_turns_a_spinning_block_with_an_error_of_first_order) {
  const auto end = [](int hertz) {
    Model model = block();
    model.roots[0].velocity << 0, 0, 5, 3, 1, 0;
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / hertz, Integrator::euler);
    batch.step(6 * hertz / 5);
    return Eigen::Vector2d(pose(batch, 0), pose(batch, 1));
  };
  const Eigen::Vector2d truth = end(3840);
  const double coarse = (end(120) - truth).norm(), fine = (end(240) - truth).norm(), finer = (end(480) - truth).norm();
  EXPECT_LT(fine, 0.01);
  EXPECT_NEAR(coarse / fine, 2.0, 0.5);
  EXPECT_NEAR(fine / finer, 2.0, 0.5);
}

TYPED_TEST(Blocks, stacks_come_to_rest_whatever_the_mass_on_top) {
  for (const double top : {1.0, 10.0, 100.0}) {
    Batch<TypeParam> batch = batch_of<TypeParam>(stack(top));
    batch.step(480);
    double fastest = 0.0;
    for (int i = 0; i < 2400; ++i) {
      batch.step(1);
      fastest = std::max(fastest, static_cast<double>(batch.root_velocities().col(0).abs().maxCoeff()));
    }
    EXPECT_LT(fastest, this->is_double ? 1e-8 : 1e-5) << top << " kg on top";
    EXPECT_NEAR(pose(batch, 16), 0.25, 5e-4) << top << " kg on top";
  }
}

TYPED_TEST(Blocks, a_ball_that_rolls_goes_on_rolling) {
  Model model = ball({0, 0, 0.1});
  model.roots[0].velocity << 0, 10, 0, 1, 0, 0;
  Batch<TypeParam> batch = batch_of<TypeParam>(model);
  batch.step(1200);
  const Eigen::Vector3d turning(velocity(batch, 0), velocity(batch, 1), velocity(batch, 2)),
      moving(velocity(batch, 3), velocity(batch, 4), velocity(batch, 5));
  EXPECT_NEAR(moving.norm(), 1.0, 1e-5);
  EXPECT_NEAR(0.1 * turning.norm(), 1.0, 2e-5);
}

TYPED_TEST(Blocks, a_sliding_ball_comes_to_roll_at_five_sevenths_of_its_speed) {
  Model model = ball({0, 0, 0.1});
  model.roots[0].velocity << 0, 0, 0, 1, 0, 0;
  Batch<TypeParam> batch = batch_of<TypeParam>(model);
  batch.step(480);
  const Eigen::Vector3d moving(velocity(batch, 3), velocity(batch, 4), velocity(batch, 5));
  EXPECT_NEAR(moving.norm(), 5.0 / 7.0, 2e-4);
}

// The share e of the speed is the share e^2 of the height, wherever in a step the ball arrives.
TYPED_TEST(Blocks, a_bounce_gives_back_its_share_of_the_speed) {
  for (const double restitution : {0.5, 0.8, 1.0})
    for (const double height : {1.0, 0.997, 0.9931}) {
      Batch<TypeParam> batch = batch_of<TypeParam>(ball({0, 0, 0.1 + height}, 0.5, restitution));
      double top = 0.0;
      bool rises = false;
      for (int i = 0; i < 216; ++i) {
        batch.step(1);
        rises = rises || velocity(batch, 5) > 0.0;
        if (rises) top = std::max(top, pose(batch, 2) - 0.1);
        if (rises && velocity(batch, 5) < 0.0) break;
      }
      const double expected = restitution * restitution * height;
      EXPECT_NEAR(top, expected, 0.03 * expected) << restitution << " from " << height;
    }
}

TYPED_TEST(Blocks, a_perfect_bounce_keeps_its_height_for_ever) {
  Batch<TypeParam> batch = batch_of<TypeParam>(ball({0, 0, 1.1}, 0.5, 1.0));
  batch.step(240 * 50);
  double top = 0.0;
  for (int i = 0; i < 480; ++i) {
    batch.step(1);
    top = std::max(top, pose(batch, 2) - 0.1);
  }
  EXPECT_NEAR(top, 1.0, 0.02);
}

TYPED_TEST(Blocks, an_overlap_is_pushed_out_without_a_hop) {
  Model model = block();
  model.roots[0].pose.translation().z() = 0.04;
  Batch<TypeParam> batch = batch_of<TypeParam>(model);
  double highest = 0.0, fastest = 0.0;
  for (int i = 0; i < 480; ++i) {
    batch.step(1);
    highest = std::max(highest, pose(batch, 2) - 0.05), fastest = std::max(fastest, velocity(batch, 5));
  }
  EXPECT_LT(highest, 1e-7);
  EXPECT_LT(fastest, 0.02);
  EXPECT_NEAR(pose(batch, 2), 0.05, 1e-5);
}

TYPED_TEST(Blocks, what_flies_keeps_the_bits_that_it_has_without_colliders) {
  Model model = block();
  model.roots[0].pose.translation().z() = 3.0;
  model.roots[0].velocity << 1, 2, 3, 1, 0.5, 2;
  Model bare = model;
  bare.colliders.clear(), bare.contacts.clear();
  StepSettings settings;
  settings.integrator = Integrator::euler;
  Batch<TypeParam> with(compile(model, settings), 3, {.threads = 1});
  Batch<TypeParam> without(compile(bare, settings), 3, {.threads = 1, .engine = Engine::tables});
  with.step(120), without.step(120);
  EXPECT_TRUE((with.root_poses() == without.root_poses()).all());
  EXPECT_TRUE((with.root_velocities() == without.root_velocities()).all());
}

// 200 m/s is 0.83 m a step; the block is 0.1 m.
TYPED_TEST(Blocks, fast_bodies_do_not_pass_through) {
  for (const double speed : {5.0, 50.0, 200.0}) {
    Model model = block();
    model.roots[0].pose.translation().z() = 2.0;
    model.roots[0].velocity << 0, 0, 0, 0, 0, -speed;
    add_block(model, "thin", 10.0, {1.0, 1.0, 0.02}, {0, 0, 0.5}, 0.5);
    model.contacts = {{"thin", "block"}, {"floor", "thin"}};
    Batch<TypeParam> batch = batch_of<TypeParam>(model);
    for (int i = 0; i < 240; ++i) {
      batch.step(1);
      ASSERT_GT(pose(batch, 2), pose(batch, 9)) << speed << " m/s, step " << i;
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
  }
}

// Painleve's rod: where friction of this size asks for two forces or none, the rod jams and is thrown back. It does not
// sink, and energy never comes from nowhere, up to the error of the step.
TYPED_TEST(Blocks, a_rod_that_jams_by_friction_is_thrown_back_without_energy_from_nowhere) {
  const double tilt = -0.4, length = 1.0, radius = 0.01;
  Model model;
  model.name = "rod";
  add_free(model, "rod", {1.0, Vector3d::Zero(), Vector3d(1.0 / 12, 1.0 / 12, 1e-4).asDiagonal()},
           Shape::capsule(radius, length), {0, 0, std::cos(tilt) * length / 2 + radius}, 3.0);
  model.roots[0].pose.linear() = Eigen::AngleAxisd(tilt, Vector3d::UnitY()).toRotationMatrix();
  model.roots[0].velocity.tail<3>() = model.roots[0].pose.linear().transpose() * Vector3d(3.0, 0, 0);
  add_floor(model, 3.0);
  model.contacts = {{"floor", "rod"}};
  double deepest[2] = {}, gained[2] = {};
  for (int k = 0; k < 2; ++k) {
    const int rate = k == 0 ? 240 : 1920;
    Batch<TypeParam> batch = batch_of<TypeParam>(model, 1.0 / rate);
    const auto read = [&](Quantity quantity) {
      Eigen::Array<TypeParam, Eigen::Dynamic, 3, Eigen::RowMajor> numbers(batch.plan().query_rows({quantity}), 3);
      const Query query{quantity};
      batch.read(std::span(&query, 1), {numbers.data(), 3, 1});
      return numbers.col(0).template cast<double>().eval();
    };
    const auto energy = [&] { return read(Quantity::kinetic_energy)[0] + read(Quantity::potential_energy)[0]; };
    double before = energy();
    for (int i = 0; i < 3 * rate / 10; ++i) {
      batch.step(1);
      const double now = energy();
      gained[k] = std::max(gained[k], now - before);
      before = now;
      deepest[k] = std::max(deepest[k], -read(Quantity::contact_gap).minCoeff());
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
  }
  EXPECT_LT(std::max(deepest[0], deepest[1]), 2e-5);
  EXPECT_LT(gained[0], 0.02);  // of 9 J
  EXPECT_LT(gained[1], 0.25 * gained[0]);
}

}  // namespace
}  // namespace lockstep
