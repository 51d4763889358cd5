// What plans record over the steps of a call: efforts of drives by their momentum, history of contacts.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr double mass = 2.0, gravity = 9.81, dt = 0.004;

/// A mass on a vertical slider with a servo.
Model slider(double kp, double kd, double effort_limit) {
  Model model;
  model.name = "slider";
  model.gravity = {0, 0, -gravity};
  model.links = {{"base", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())},
                 {"load", Inertia::box(mass, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
  Joint joint;
  joint.name = "lift", joint.kind = JointKind::prismatic, joint.parent = "base", joint.child = "load";
  joint.axis = Vector3d::UnitZ();
  joint.drive.kp = kp, joint.drive.kd = kd, joint.effort_limit = effort_limit;
  model.joints = {joint};
  return model;
}

StepSettings recorded(Integrator integrator) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator;
  settings.record_efforts = settings.record_contacts = true;
  return settings;
}

class DriveEffort : public testing::TestWithParam<Integrator> {};
INSTANTIATE_TEST_SUITE_P(integrator, DriveEffort, testing::Values(Integrator::euler, Integrator::leapfrog),
                         [](const auto& tested) { return std::string(to_string(tested.param)); });

// m (v' - v) = h (effort - m g), whatever the drive does, also where environments differ in limits and targets.
TEST_P(DriveEffort, is_what_changes_the_momentum) {
  StepSettings settings = recorded(GetParam());
  settings.per_environment = {Parameter::effort_limit};
  Batch<double> batch(compile(slider(900.0, 30.0, 60.0), settings), 5, {.threads = 1});
  for (int e = 0; e < 5; ++e) {
    batch.position_targets()(0, e) = 0.04 * e;
    batch.efforts()(0, e) = 3.0 * e;
    batch.parameter(Parameter::effort_limit)(0, e) = 15.0 + 10.0 * e;
  }
  bool limited = false, free = false;
  for (int step = 0; step < 300; ++step) {
    const Eigen::ArrayXXd before = batch.velocities();
    batch.step();
    const Eigen::ArrayXXd effort = read(batch, Quantity::drive_effort);
    for (int e = 0; e < 5; ++e) {
      EXPECT_NEAR(effort(0, e), mass * ((batch.velocities()(0, e) - before(0, e)) / dt + gravity), 1e-8) << step;
      const double limit = 15.0 + 10.0 * e;
      EXPECT_LE(std::abs(effort(0, e)), limit * (1.0 + 1e-12));
      (std::abs(effort(0, e)) > limit * (1.0 - 1e-12) ? limited : free) = true;
    }
  }
  EXPECT_TRUE(limited && free);
}

TEST_P(DriveEffort, bears_the_weight_at_rest) {
  Batch<double> batch(compile(slider(900.0, 60.0, infinity), recorded(GetParam())), 2, {.threads = 1});
  batch.step(2000);
  for (const Quantity quantity : {Quantity::drive_effort, Quantity::drive_effort_mean}) {
    batch.step(10);
    EXPECT_NEAR(read(batch, quantity)(0, 1), mass * gravity, 1e-6) << to_string(quantity);
  }
}

TEST_P(DriveEffort, has_the_peak_and_the_mean_of_a_call) {
  const Plan plan = compile(slider(900.0, 30.0, 60.0), recorded(GetParam()));
  Batch<double> one(plan, 1, {.threads = 1}), whole(plan, 1, {.threads = 1});
  one.position_targets()(0, 0) = whole.position_targets()(0, 0) = 0.1;
  double peak = 0.0, sum = 0.0;
  for (int step = 0; step < 20; ++step) {
    one.step();
    const double effort = read(one, Quantity::drive_effort)(0, 0);
    peak = std::max(peak, std::abs(effort)), sum += effort;
  }
  whole.step(20);
  EXPECT_EQ(read(whole, Quantity::drive_effort)(0, 0), read(one, Quantity::drive_effort)(0, 0));
  EXPECT_EQ(read(whole, Quantity::drive_effort_peak)(0, 0), peak);
  EXPECT_NEAR(read(whole, Quantity::drive_effort_mean)(0, 0), sum / 20, 1e-12 * peak);
  whole.reset();
  EXPECT_EQ(read(whole, Quantity::drive_effort_peak)(0, 0), 0.0);
}

// Without gravity, a servo that pulls is the mirror image of one that pushes.
TEST_P(DriveEffort, has_the_peak_of_a_pull) {
  Model model = slider(900.0, 30.0, 60.0);
  model.gravity.setZero();
  Batch<double> batch(compile(model, recorded(GetParam())), 2, {.threads = 1});
  batch.position_targets()(0, 0) = 0.1, batch.position_targets()(0, 1) = -0.1;
  batch.step(20);
  const auto peak = read(batch, Quantity::drive_effort_peak), mean = read(batch, Quantity::drive_effort_mean);
  EXPECT_GT(peak(0, 0), 1.0);
  EXPECT_NEAR(peak(0, 1), peak(0, 0), 1e-9);
  EXPECT_NEAR(mean(0, 1), -mean(0, 0), 1e-9);
}

TEST(Records, change_no_bit_of_a_step) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    StepSettings settings = recorded(integrator);
    Batch<float> with(compile(block(), settings), 3, {.threads = 1});
    settings.record_efforts = settings.record_contacts = false;
    Batch<float> without(compile(block(), settings), 3, {.threads = 1});
    for (Batch<float>* batch : {&with, &without}) batch->root_velocities().row(3) = 0.7f, batch->step(100);
    EXPECT_TRUE((with.root_poses() == without.root_poses()).all());
    EXPECT_TRUE((with.root_velocities() == without.root_velocities()).all());
  }
}

/// A block that falls from a height.
Model falling(double height) {
  Model model = block();
  model.roots[0].pose.translation().z() += height;
  return model;
}

TEST(ContactHistory, times_a_flight_and_the_contact_after_it) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Plan plan = compile(falling(0.1), recorded(integrator));
    Batch<double> batch(plan, 1, {.threads = 1});
    int air = 0, touch = 0;
    for (int step = 0; step < 100; ++step) {
      batch.step();
      const bool touches = read(batch, Quantity::contact_normal_force)(0, 0) > 0.0;
      const bool first = touches && air > 0 && touch == 0;
      if (first) {
        EXPECT_NEAR(read(batch, Quantity::contact_last_air_time)(0, 0), std::sqrt(0.2 / gravity), 2 * dt);
        EXPECT_EQ(read(batch, Quantity::contact_last_air_time)(0, 0), dt * air);
      }
      air = touches ? 0 : air + 1, touch = touches ? touch + 1 : 0;
      EXPECT_EQ(read(batch, Quantity::contact_first_touch)(0, 0), first ? 1.0 : 0.0) << step;
      EXPECT_EQ(read(batch, Quantity::contact_time)(0, 0), dt * touch) << step;
      EXPECT_EQ(read(batch, Quantity::contact_air_time)(0, 0), dt * air) << step;
    }
    EXPECT_GT(touch, 20);
  }
}

TEST(ContactHistory, has_the_weight_as_mean_and_the_impact_as_peak) {
  Batch<double> batch(compile(falling(0.1), recorded(Integrator::euler)), 1, {.threads = 1});
  batch.step(100);  // what falls and then rests has given its momentum to the floor
  const Eigen::ArrayXXd mean = read(batch, Quantity::contact_mean_force);
  EXPECT_NEAR(std::abs(mean(2, 0)), 9.81, 0.01 * 9.81);
  EXPECT_GT(read(batch, Quantity::contact_peak_force)(0, 0), 0.5 * std::sqrt(2 * gravity * 0.1) / dt);
  batch.step(10);
  EXPECT_NEAR(read(batch, Quantity::contact_peak_force)(0, 0), 9.81, 1e-3);
  EXPECT_EQ(read(batch, Quantity::contact_first_touch)(0, 0), 0.0);
}

TEST(ContactHistory, goes_on_from_a_save_and_begins_anew_with_a_reset) {
  const Plan plan = compile(falling(0.02), recorded(Integrator::leapfrog));
  Batch<double> batch(plan, 3, {.threads = 1}), other(plan, 3, {.threads = 1});
  batch.step(40);
  other.restore(batch.save());
  const int one[] = {1};
  for (Batch<double>* own : {&batch, &other}) own->reset(EnvironmentSet(one)), own->step(7);
  for (const Quantity quantity : {Quantity::contact_time, Quantity::contact_air_time, Quantity::contact_last_air_time,
                                  Quantity::contact_peak_force, Quantity::contact_mean_force})
    EXPECT_TRUE((read(batch, quantity) == read(other, quantity)).all()) << to_string(quantity);
  EXPECT_GT(read(batch, Quantity::contact_time)(0, 0), 7 * dt);
  EXPECT_EQ(read(batch, Quantity::contact_air_time)(0, 1), 7 * dt);
  EXPECT_EQ(read(batch, Quantity::contact_last_air_time)(0, 1), 0.0);
}

template <class Error, class Act>
void expect_error(const Act& act, const std::string& words) {
  try {
    act();
    FAIL() << words;
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(Records, are_refused_where_nothing_declares_or_keeps_them) {
  const Plan plan = compile(block());
  expect_error<UsageError>([&] { plan.query_rows({Quantity::drive_effort}); }, "StepSettings::record_efforts");
  expect_error<UsageError>([&] { plan.query_rows({Quantity::contact_time}); }, "StepSettings::record_contacts");
  expect_error<SettingsError>([] { compile(slider(9.0, 1.0, infinity), recorded(Integrator::runge_kutta)); },
                              "leapfrog or euler");
  Model model = slider(0.0, 0.0, infinity);
  model.joints[0].drive.kinematic = true;
  expect_error<SettingsError>([&] { compile(model, recorded(Integrator::euler)); }, "lift");
  const Plan kept = compile(slider(9.0, 1.0, infinity), recorded(Integrator::euler));
  EXPECT_THROW(Batch<double>(kept, 1, {.threads = 1, .engine = Engine::compiled}), SettingsError);
}

// Two links swing so fast on a body that bounces that the guard takes its steps in parts: each part counts.
TEST(ContactHistory, has_the_impulses_of_all_parts_of_a_step) {
  Model model;
  model.gravity.setZero();
  const Inertia swings = {1.0, {0.3, 0.0, 0.0}, Vector3d(0.01, 0.01, 0.01).asDiagonal()};
  model.links = {{"body", Inertia::box(2.0, {0.2, 0.2, 0.2}, Vector3d::Zero())}, {"one", swings}, {"other", swings}};
  model.roots = {{"body", true, at({0, 0, 2}), {0, 0, 0, 0, 0, -3}}};
  for (const auto& [parent, child] : {std::pair("body", "one"), std::pair("one", "other")}) {
    Joint& joint = model.joints.emplace_back();
    joint.name = child, joint.kind = JointKind::continuous, joint.parent = parent, joint.child = child;
    joint.axis = Vector3d::UnitY(), joint.origin = at({child[1] == 'n' ? 0.0 : 0.5, 0, 0});
  }
  model.colliders = {
      {.name = "ball", .link = "body", .shape = Shape::sphere(0.1), .friction = 0.0, .restitution = 0.8}};
  add_floor(model, 0.0);
  model.contacts = {{"floor", "ball"}};
  constexpr int environments = 32;
  for (const int rate : {60, 120}) {
    StepSettings settings = recorded(Integrator::leapfrog);
    settings.dt = 1.0 / rate;
    Batch<double> batch(compile(model, settings), environments, {.threads = 1});
    for (int e = 0; e < environments; ++e) {
      batch.positions().col(e) << 0.2 * e, -0.1 * e;
      batch.velocities().col(e) << 15.0, -15.0;
    }
    Eigen::ArrayXd impulse = Eigen::ArrayXd::Zero(environments), touches = impulse, gained = impulse;
    for (int i = 0; i < 6 * rate / 5; ++i) {
      const Eigen::ArrayXd before = batch.momenta().row(5).transpose();
      batch.step(1);
      const Eigen::ArrayXd own = read(batch, Quantity::contact_mean_force).row(2).transpose() * settings.dt,
                           change = batch.momenta().row(5).transpose() - before;
      impulse += own, gained += (change.abs() > 0.5).select(change, 0.0);  // the rest is what swinging loses
      touches += read(batch, Quantity::contact_first_touch).row(0).transpose();
    }
    int bounced = 0;
    for (int e = 0; e < environments; ++e) {
      if (batch.faults()[static_cast<std::size_t>(e)] != Fault::none || gained[e] < 1.0) continue;
      ++bounced;
      EXPECT_GE(touches[e], 1.0) << rate << ' ' << e;
      EXPECT_NEAR(impulse[e], gained[e], 0.1 * gained[e]) << rate << ' ' << e;
    }
    EXPECT_GE(bounced, 8) << rate;
  }
}

}  // namespace
}  // namespace lockstep
