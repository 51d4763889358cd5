// Torsional and rolling friction against theory. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "physics.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr double radius = 0.1, mass = 1.0, moment = 0.004, gravity = 9.81, friction = 0.5;

StepSettings settings_of(Integrator integrator) {
  StepSettings settings;
  settings.integrator = integrator;
  return settings;
}

// A ball that lies on the floor.
Model resting_ball(double torsional, double rolling) {
  Model model = ball({0, 0, radius});
  model.colliders[0].torsional_friction = torsional, model.colliders[0].rolling_friction = rolling;
  return model;
}

// The same on a floor that is tilted towards +x, gravity in its place.
Model ball_on_slope(double rolling, double slope) {
  Model model = resting_ball(0.0, rolling);
  const double angle = std::atan(slope);
  model.gravity = {gravity * std::sin(angle), 0.0, -gravity * std::cos(angle)};
  return model;
}

template <class S>
Batch<S> batch_of(const Model& model, Integrator integrator) {
  return Batch<S>(compile(model, settings_of(integrator)), 1, {.threads = 1});
}
template <class S>
void run(Batch<S>& batch, double seconds) {
  batch.step(static_cast<int>(std::lround(seconds / batch.plan().settings().dt)));
  ASSERT_EQ(batch.faulted(), 0);
}

// The motion that (M171) gives a rolling ball, by small steps: friction and moment are against slip and rotation.
struct Roll {
  double v, turn;  // m/s along x, rad/s about y
  double x = 0.0;

  void advance(double seconds, double rolling, double slope) {
    constexpr double h = 1e-6;
    const double cosine = 1.0 / std::sqrt(1.0 + slope * slope), normal = mass * gravity * cosine;
    const double length = rolling / friction;
    for (long i = 0; i < std::lround(seconds / h); ++i) {
      const double slip = v - radius * turn, size = std::hypot(slip, length * turn);
      const double share = friction * normal / std::max(size, 1e-6);
      const double force = -share * slip, brakes = -share * length * length * turn;
      v += h * (force / mass + gravity * slope * cosine);
      turn += h * (brakes - radius * force) / moment;
      x += h * v;
    }
  }
};

// act(a batch, its largest rounding error at 1).
template <class Act>
void each_kind(const Model& model, Act&& act) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> exact = batch_of<double>(model, integrator);
    act(exact);
    Batch<float> single = batch_of<float>(model, integrator);
    act(single);
  }
}

TEST(TurningFriction, a_ball_that_spins_stops_when_theory_says) {
  constexpr double torsional = 0.01, spin = 20.0, stops = moment * spin / (torsional * mass * gravity);
  Model model = resting_ball(torsional, 0.0);
  model.roots[0].velocity[2] = spin;
  each_kind(model, [&](auto& batch) {
    run(batch, 0.9 * stops);
    EXPECT_NEAR(batch.root_velocities()(2, 0), 0.1 * spin, 0.01 * spin);
    run(batch, 0.2 * stops);
    EXPECT_LT(std::abs(batch.root_velocities()(2, 0)), 1e-3);
    for (int k = 0; k < 2; ++k) EXPECT_LT(std::abs(batch.root_poses()(k, 0)), 1e-5);
  });
}

TEST(TurningFriction, without_it_a_ball_spins_and_rolls_for_ever) {
  Model model = resting_ball(0.0, 0.0);
  model.roots[0].velocity << 0.0, 10.0, 20.0, 1.0, 0.0, 0.0;
  Batch<double> batch = batch_of<double>(model, Integrator::leapfrog);
  run(batch, 5.0);
  EXPECT_NEAR(physics::state_of(batch).roots[0].position.x(), 5.0, 1e-3);
}

TEST(TurningFriction, a_ball_that_rolls_slows_down_as_theory_says) {
  constexpr double rolling = 0.005, speed = 1.0;
  Roll early{speed, speed / radius}, stopped = early;
  early.advance(1.0, rolling, 0.0), stopped.advance(3.1, rolling, 0.0);
  ASSERT_LT(stopped.v, 1e-3);
  EXPECT_NEAR(stopped.x, 0.5 * 1.4 * radius * speed * speed / (rolling * gravity), 0.01);  // without slip
  Model model = resting_ball(0.0, rolling);
  model.roots[0].velocity << 0.0, speed / radius, 0.0, speed, 0.0, 0.0;
  each_kind(model, [&](auto& batch) {
    const auto speed_of = [&] { return physics::state_of(batch).v.tail(3).norm(); };
    run(batch, 1.0);
    EXPECT_NEAR(speed_of(), early.v, 2e-4);
    run(batch, 2.1);
    EXPECT_LT(speed_of(), 1e-3);
    const double stands = physics::state_of(batch).roots[0].position.x();
    EXPECT_NEAR(stands, stopped.x, 3e-3);
    run(batch, 5.0);
    EXPECT_NEAR(physics::state_of(batch).roots[0].position.x(), stands, 1e-4);
  });
}

TEST(TurningFriction, a_ball_rests_on_a_slope_below_the_limit) {
  constexpr double rolling = 0.01;
  const double limit = 1.0 / std::hypot(1.0 / friction, radius / rolling);
  each_kind(ball_on_slope(rolling, 0.97 * limit), [&](auto& batch) {
    run(batch, 10.0);
    const double before = physics::state_of(batch).roots[0].position.x();
    EXPECT_LT(std::abs(before), 1e-3);
    run(batch, 50.0);
    EXPECT_LT(std::abs(physics::state_of(batch).roots[0].position.x() - before), 1e-4);
  });
  Roll rolls{0.0, 0.0};
  rolls.advance(2.0, rolling, 1.1 * limit);
  EXPECT_GT(rolls.x, 0.1);
  each_kind(ball_on_slope(rolling, 1.1 * limit), [&](auto& batch) {
    run(batch, 2.0);
    EXPECT_NEAR(physics::state_of(batch).roots[0].position.x(), rolls.x, 0.01);
  });
}

// A plate between two round tips above its middle. One stands, the other is pushed.
Model pinched_plate(double torsional) {
  Model model;
  model.name = "pinch";
  constexpr double above = 0.03;
  model.links.push_back({"base", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())});
  model.links.push_back({"finger", Inertia::box(0.2, {0.02, 0.02, 0.02}, Vector3d::Zero())});
  model.roots.push_back({"base"});
  Joint push = joint("push", JointKind::prismatic, "base", "finger", {0.02, 0.0, above}, -Vector3d::UnitX());
  push.effort = 20.0;
  model.joints.push_back(push);
  model.colliders.push_back({.name = "anvil", .shape = Shape::sphere(0.01), .pose = at({-0.02, 0.0, above})});
  model.colliders.push_back({.name = "tip", .link = "finger", .shape = Shape::sphere(0.01)});
  add_block(model, "plate", 0.2, {0.02, 0.1, 0.1}, {0, 0, 0}, 0.8);
  for (Collider& collider : model.colliders) collider.friction = 0.8, collider.torsional_friction = torsional;
  model.contacts = {{"anvil", "plate"}, {"tip", "plate"}};
  // The plate's middle is beside the tips, so it hangs askew.
  model.roots.back().pose.translation() += Vector3d(0.0, above, above);
  return model;
}

TEST(TurningFriction, two_fingertips_hold_a_plate_askew) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const auto turned = [&](double torsional) {
      Batch<double> batch = batch_of<double>(pinched_plate(torsional), integrator);
      run(batch, 3.0);
      double most = 0.0;
      for (int i = 0; i < 20; ++i) {
        run(batch, 0.05);
        const Eigen::Quaterniond now = physics::state_of(batch).roots.back().orientation;
        most = std::max(most, 2.0 * std::acos(std::min(1.0, std::abs(now.w()))));
      }
      return most;
    };
    EXPECT_LT(turned(0.005), 5e-3);  // holds 0.2 N m against 0.06
    EXPECT_GT(turned(0.0), 0.5);
  }
}

// What the solver may do with a friction that is refused.
TEST(TurningFriction, is_refused_where_nothing_rubs) {
  Model model = resting_ball(0.01, 0.0);
  for (Collider& collider : model.colliders) collider.friction = 0.0;
  EXPECT_THROW(compile(model), ModelError);
  model = resting_ball(-0.01, 0.0);
  EXPECT_THROW(compile(model), ModelError);
  model = resting_ball(0.0, 0.0);
  model.contacts[0].rolling_friction = std::nan("");
  EXPECT_THROW(compile(model), ModelError);
}

}  // namespace
}  // namespace lockstep
