// Contacts of fast bodies, and of rough ones: nothing passes through what it hits. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

class Random {
 public:
  explicit Random(unsigned seed) : generator_(seed) {}
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(generator_); }
  Eigen::Quaterniond turn() {
    const auto normal = [&] { return std::normal_distribution<double>()(generator_); };
    return Eigen::Quaterniond(normal(), normal(), normal(), normal()).normalized();
  }

 private:
  std::mt19937 generator_;
};

StepSettings settings_of(Integrator integrator, double dt = 1.0 / 240.0) {
  StepSettings settings;
  settings.integrator = integrator, settings.dt = dt;
  return settings;
}

// Two bodies in space, `shape` of 2 cm each, without friction.
Model two_bodies(const Shape& shape) {
  Model model;
  model.gravity.setZero();
  for (const char* name : {"one", "other"})
    add_free(model, name, Inertia::box(0.1, Vector3d::Constant(0.02), Vector3d::Zero()), shape,
             Vector3d(name[1] == 'n' ? 0.0 : 1.0, 0, 0), 0.0);
  model.contacts = {{"one", "other"}};
  return model;
}

// By steps so short that nothing happens between them.
TEST(FastBoxes, miss_no_corner_that_they_hit) {
  constexpr int environments = 200, finer = 64;
  constexpr double speed = 20.0;
  const Model model = two_bodies(Shape::box(Vector3d::Constant(0.02)));
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const auto hit = [&](double dt) {
      Batch<double> batch(compile(model, settings_of(integrator, dt)), environments, {.threads = 1});
      Random random(5);
      for (int e = 0; e < environments; ++e) {
        const Eigen::Quaterniond turn = random.turn(), other = random.turn();
        batch.root_poses().col(e) << 0, 0, 0, turn.w(), turn.x(), turn.y(), turn.z(), random.uniform(0.1, 0.2),
            random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), other.w(), other.x(), other.y(), other.z();
        batch.root_velocities().col(e) << 0, 0, 0, 0, 0, 0, 0, 0, 0, other.conjugate() * Vector3d(-speed, 0, 0);
      }
      batch.step(static_cast<int>(std::lround(4.0 / 240.0 / dt)));
      return (batch.root_velocities().topRows(6).abs().colwise().maxCoeff() > 1e-6).eval();
    };
    const auto truth = hit(1.0 / 240.0 / finer), found = hit(1.0 / 240.0);
    EXPECT_GT(truth.count(), environments / 4);
    EXPECT_EQ((truth && !found).count(), 0) << to_string(integrator);
  }
}

// What bounces in a later step of a leapfrog would be behind the plate by then.
TEST(FastBodies, do_not_pass_through_thin_plates_that_they_bounce_off) {
  constexpr int environments = 128;
  for (const Shape& shape : {Shape::sphere(0.01), Shape::box(Vector3d::Constant(0.02))})
    for (const double thickness : {0.002, 0.02})
      for (const double speed : {3.0, 10.0, 20.0, 40.0}) {
        Model model;
        model.gravity.setZero();
        add_free(model, "body", Inertia::box(0.1, Vector3d::Constant(0.02), Vector3d::Zero()), shape, {0, 0, 0.2}, 0.0);
        model.colliders.push_back({.name = "plate", .shape = Shape::box({1.0, 1.0, thickness}), .friction = 0.0});
        for (Collider& collider : model.colliders) collider.restitution = 0.5;
        model.contacts = {{"plate", "body"}};
        Batch<double> batch(compile(model, settings_of(Integrator::leapfrog)), environments, {.threads = 1});
        Random random(3);
        for (int e = 0; e < environments; ++e) {
          batch.root_poses()(2, e) = 0.2 + random.uniform(0.0, speed / 240.0);
          batch.root_velocities()(5, e) = -speed;
        }
        batch.step(static_cast<int>(120.0 * std::max(0.1, 0.6 / speed)));
        for (int e = 0; e < environments; ++e) {
          EXPECT_GT(batch.root_poses()(2, e), 0.0) << thickness << ' ' << speed << ' ' << e;
          EXPECT_NEAR(batch.root_velocities()(5, e), 0.5 * speed, 0.01 * speed)
              << thickness << ' ' << speed << ' ' << e;
        }
      }
}

// Friction that no slip can follow holds at once. It must not let the body in.
TEST(RoughBodies, land_on_the_floor_and_not_in_it) {
  constexpr int environments = 64;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const double friction : {1.0, 2.0, 10.0}) {
      Model model;
      add_block(model, "box", 1.0, Vector3d::Constant(0.2), {0, 0, 0.2}, friction);
      add_floor(model, friction);
      for (Collider& collider : model.colliders) collider.friction = friction;
      model.contacts = {{"floor", "box"}};
      Batch<double> batch(compile(model, settings_of(integrator)), environments, {.threads = 1});
      Random random(11);
      for (int e = 0; e < environments; ++e) {
        batch.root_poses()(2, e) = 0.1 + random.uniform(0.0, 0.07);
        batch.root_velocities()(3, e) = random.uniform(0.2, 3.0);
      }
      double deepest = 0.0;
      for (int i = 0; i < 240; ++i) {
        batch.step(1);
        deepest = std::min(deepest, read(batch, Quantity::contact_gap).minCoeff());
      }
      EXPECT_GT(deepest, -0.003) << to_string(integrator) << ' ' << friction;
      EXPECT_EQ(batch.faulted(), 0);
    }
}

// A box slides v^2 / (2 mu g), whatever the friction.
TEST(RoughBodies, slide_as_far_as_they_should) {
  for (const double friction : {1.0, 1.5, 3.0}) {
    Model model;
    add_block(model, "slab", 1.0, {0.2, 0.2, 0.05}, {0, 0, 0.025}, friction);
    add_floor(model, friction);
    model.contacts = {{"floor", "slab"}};
    Batch<double> batch(compile(model, settings_of(Integrator::leapfrog)), 6, {.threads = 1});
    for (int e = 0; e < 6; ++e) batch.root_velocities()(3, e) = 0.5 + 0.5 * e;
    batch.step(240);
    for (int e = 0; e < 6; ++e) {
      const double v = 0.5 + 0.5 * e, way = v * v / (2.0 * friction * 9.81);
      EXPECT_NEAR(batch.root_poses()(0, e), way, 0.02 * way) << friction;
      EXPECT_NEAR(batch.root_poses()(2, e), 0.025, 5e-5) << friction;
    }
  }
}

TEST(RoughBodies, have_a_friction_of_at_most_100) {
  Model model = block(100.0);
  StepSettings settings = settings_of(Integrator::automatic);
  settings.per_environment = {Parameter::contact_friction};
  Batch<double> batch(compile(model, settings), 2, {.threads = 1});
  batch.parameter(Parameter::contact_friction)(0, 1) = 101.0;
  batch.step(1);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  model.colliders[0].friction = 101.0;
  EXPECT_THROW(compile(model), ModelError);
}

}  // namespace
}  // namespace lockstep
