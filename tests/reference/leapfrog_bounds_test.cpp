// Bounds within leapfrog steps, against the motion found event by event. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "contract.h"
#include "physics.h"
#include "reference/events.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;

constexpr int instants = 30;

// Arms of up to three links of 0.4 m, which swing about horizontal axes.
Model arm(int joints, double damping = 0.0) {
  Model model;
  model.name = "arm";
  model.links.push_back({"base", {}});
  for (int i = 0; i < joints; ++i) {
    const std::string name = std::to_string(i);
    model.links.push_back({"l" + name, Inertia::box(1.0 - 0.3 * i, {0.4, 0.04, 0.04}, {0.2, 0.0, 0.0})});
    Joint joint;
    joint.name = "j" + name;
    joint.kind = JointKind::revolute;
    joint.parent = i == 0 ? "base" : "l" + std::to_string(i - 1);
    joint.child = "l" + name;
    joint.axis = Vector3d::UnitY();
    joint.damping = damping;
    if (i > 0) joint.origin.translation() = Vector3d(0.4, 0.0, 0.0);
    model.joints.push_back(joint);
  }
  return model;
}

Model slider(const Vector3d& axis) {
  Model model = arm(1);
  model.joints[0].kind = JointKind::prismatic;
  model.joints[0].axis = axis;
  return model;
}

Model chain8_with(void (*change)(Joint&)) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) change(joint);
  return model;
}

// RMS error of all positions at `instants` times of one second.
template <class S = double>
double rms(const Model& model, Integrator integrator, int rate, double seconds = 1.0) {
  const reference::Mechanism mechanism(model);
  const reference::Motion truth = reference::integrate_with_events(mechanism, mechanism.initial_state(),
                                                                   reference::held, seconds / instants, instants, 120);
  StepSettings settings;
  settings.dt = 1.0 / rate;
  settings.integrator = integrator;
  Batch<S> batch(compile(model, settings), 1, {.threads = 1});
  const int steps = static_cast<int>(std::lround(seconds * rate / instants));
  double sum = 0.0;
  for (int i = 1; i <= instants; ++i) {
    batch.step(steps);
    sum +=
        (batch.positions().col(0).template cast<double>() - truth.positions.row(i).transpose().array()).square().sum();
  }
  EXPECT_EQ(batch.faulted(), 0);
  return std::sqrt(sum / (instants * mechanism.dofs()));
}

double order(const Model& model) {
  return std::log2(rms(model, Integrator::leapfrog, 60) / rms(model, Integrator::leapfrog, 960)) / 4.0;
}

Model resting_arm() {
  Model model = arm(2, 0.02);
  model.joints[0].position = model.joints[0].upper = 0.1;
  model.joints[1].position = -0.6;
  return model;
}
Model falling_pendulum() {
  Model model = arm(1, 0.1);
  model.joints[0].upper = 0.7;
  return model;
}
Model chain8_with_friction() {
  return chain8_with([](Joint& joint) { joint.friction = 0.02; });
}

TEST(LeapfrogBounds, are_of_second_order_where_rows_rest_land_slip_and_stick) {
  for (const Model& model : {resting_arm(), falling_pendulum(), chain8_with_friction()}) {
    SCOPED_TRACE(model.name);
    EXPECT_GT(order(model), 1.85);
    EXPECT_LT(rms(model, Integrator::leapfrog, 240), 5e-5);
    EXPECT_GT(rms(model, Integrator::euler, 240), 50.0 * rms(model, Integrator::leapfrog, 240));
  }
}

TEST(LeapfrogBounds, solve_a_sliding_block_and_a_bouncing_ball_exactly) {
  Model block = slider(Vector3d::UnitX());
  block.joints[0].friction = 2.0, block.joints[0].velocity = 1.0;
  Model ball = slider(Vector3d::UnitZ());
  ball.joints[0].lower = 0.0, ball.joints[0].position = 0.5, ball.joints[0].restitution = 0.5;
  for (const int rate : {30, 120, 960}) {
    SCOPED_TRACE(rate);
    EXPECT_LT(rms(block, Integrator::leapfrog, rate), 1e-12);
    if (rate >= 120) {
      EXPECT_LT(rms(ball, Integrator::leapfrog, rate, 0.5), 1e-11);
    }
  }
}

TEST(LeapfrogBounds, are_near_the_truth_across_impacts_limits_of_velocity_and_saturated_servos) {
  Model arms = arm(2, 0.05);
  arms.joints[0].upper = 0.6, arms.joints[1].lower = -0.8, arms.joints[1].upper = 0.8;
  Model servos = arm(2);
  servos.joints[0].drive = {.kp = 40.0, .kd = 2.0}, servos.joints[0].effort_limit = 6.0;
  servos.joints[1].drive = {.kp = 10.0, .kd = 0.3, .position_target = 0.5}, servos.joints[1].effort_limit = 1.2;
  const Model chains[] = {
      chain8_with([](Joint& joint) { joint.lower = -0.45, joint.upper = 0.45; }),
      chain8_with([](Joint& joint) { joint.lower = -0.45, joint.upper = 0.45, joint.damping = 0.0; }),
      chain8_with([](Joint& joint) { joint.velocity_limit = 2.0, joint.damping = 0.0; })};
  EXPECT_LT(rms(arms, Integrator::leapfrog, 240), 1e-3);
  EXPECT_LT(rms(servos, Integrator::leapfrog, 240), 5e-4);
  EXPECT_LT(rms(chains[0], Integrator::leapfrog, 240), 2e-3);
  EXPECT_LT(rms(chains[1], Integrator::leapfrog, 240), 1.2e-3);
  EXPECT_LT(rms(chains[2], Integrator::leapfrog, 240), 1e-3);
  for (const Model& model : {arms, servos, chains[0], chains[1], chains[2]})
    EXPECT_LT(rms(model, Integrator::leapfrog, 240), 0.4 * rms(model, Integrator::euler, 240)) << model.name;
}

TEST(LeapfrogBounds, change_no_bit_where_nothing_reaches_them) {
  const Model model = scenes::gripper13(), idle = [&] {
    Model other = model;
    for (Joint& joint : other.joints) {
      joint.lower = -3.0, joint.upper = 3.0, joint.velocity_limit = 50.0;
      joint.effort_limit = 1e3;
    }
    return other;
  }();
  StepSettings settings;
  settings.integrator = Integrator::leapfrog;
  const Plan bounded = compile(idle, settings);
  settings.ignore = {true, true, true, true};
  const Plan ignoring = compile(idle, settings);
  for (const Engine engine : physics::engines()) {
    Batch<float> a(bounded, 3, {.threads = 1, .engine = engine}), b(ignoring, 3, {.threads = 1, .engine = engine});
    a.position_targets() += 0.2f, b.position_targets() += 0.2f;
    a.step(200), b.step(200);
    EXPECT_TRUE(contract::same_bits(a, b)) << to_string(engine);
  }
}

TEST(LeapfrogBounds, rest_without_any_motion_and_never_leave_a_range) {
  Model model = arm(2, 0.05);
  model.joints[0].upper = 0.7, model.joints[1].upper = 0.4, model.joints[1].lower = -0.4;
  model.joints[1].restitution = 0.5;
  for (const double dt : {1.0 / 30, 1.0 / 240, 1.0 / 1000}) {
    Batch<double> batch(compile(model, {.dt = dt}), 1, {.threads = 1});
    for (int i = 0; i < std::lround(10.0 / dt); ++i) {
      batch.step();
      ASSERT_LE(batch.positions()(0, 0), 0.7);
      ASSERT_LE(std::abs(batch.positions()(1, 0)), 0.4);
    }
    EXPECT_EQ(batch.velocities()(0, 0), 0.0);
    EXPECT_EQ(batch.velocities()(1, 0), 0.0);
    EXPECT_EQ(batch.positions()(0, 0), 0.7);
  }
}

TEST(LeapfrogBounds, return_from_beyond_a_range_without_speed) {
  Model model = arm(1);
  model.gravity.setZero();
  model.joints[0].upper = 0.5, model.joints[0].position = 0.7;
  Batch<double> batch(compile(model), 1, {.threads = 1});
  for (int i = 1; i <= 20; ++i) {
    batch.step();
    EXPECT_NEAR(batch.positions()(0, 0), 0.5 + 0.2 * std::pow(0.8, i), 1e-12);
    EXPECT_EQ(batch.velocities()(0, 0), 0.0);
  }
}

TEST(LeapfrogBounds, follow_kinematic_drives) {
  Model model = arm(2);
  model.joints[0].drive.kinematic = true;
  model.joints[0].drive.velocity_target = 0.3;
  Batch<double> batch(compile(model), 1, {.threads = 1});
  for (int i = 1; i <= 100; ++i) {
    batch.position_targets()(0, 0) = 0.3 * i / 240.0;
    batch.step();
    ASSERT_NEAR(batch.positions()(0, 0), 0.3 * i / 240.0, 1e-13);
    ASSERT_NEAR(batch.velocities()(0, 0), 0.3, 1e-12);
  }
  EXPECT_EQ(batch.plan().integrator(), Integrator::leapfrog);
}

// A gripper whose limits, servos and friction all act, floating or fixed.
Model busy(bool floating) {
  Model model = scenes::gripper13();
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    Joint& joint = model.joints[j];
    joint.lower = joint.position - 0.1, joint.upper = joint.position + 0.15;
    joint.velocity_limit = 1.5, joint.friction = 0.05;
    joint.effort_limit = 2.0;
    if (j % 3 == 0) joint.restitution = 0.4;
  }
  model.roots = {{model.links[0].name, floating}};
  if (floating) model.links[0].inertia = Inertia::box(5.0, {0.2, 0.2, 0.1}, Vector3d::Zero());
  return model;
}

TEST(LeapfrogBounds, give_the_same_bits_in_any_batch_place_and_call_by_every_engine) {
  for (const bool floating : {false, true})
    for (const Engine engine : physics::engines()) {
      StepSettings settings;
      settings.per_environment = {Parameter::gear_ratio, Parameter::position_limits, Parameter::effort_limit};
      const Plan plan = compile(busy(floating), settings);
      ASSERT_EQ(plan.integrator(), Integrator::leapfrog);
      const BatchOptions options = {.threads = 1, .engine = engine};
      Batch<float> many = contract::scattered<float>(plan, 70, options),
                   one_by_one = contract::scattered<float>(plan, 70, options);
      many.step(30);
      for (int i = 0; i < 30; ++i) one_by_one.step();
      EXPECT_TRUE(contract::same_bits(many, one_by_one));
      for (const int place : {0, 9, 69}) {
        Batch<float> single(plan, 1, options);
        contract::scatter(single, 0, static_cast<std::uint64_t>(place));
        single.step(30);
        EXPECT_TRUE(contract::same_bits(many, place, single, 0)) << to_string(engine) << floating;
      }
    }
}

TEST(LeapfrogBounds, keep_couplings_and_stay_near_double_in_single_precision) {
  const Plan plan = compile(busy(false));
  Batch<float> narrow(plan, 1, {.threads = 1});
  Batch<double> wide(plan, 1, {.threads = 1});
  narrow.efforts() += 1.0f, wide.efforts() += 1.0;
  for (int i = 0; i < 240; ++i) {
    narrow.step(), wide.step();
    ASSERT_LE(wide.coupling_errors().abs().maxCoeff(), 1e-12);
    ASSERT_LE(narrow.coupling_errors().abs().maxCoeff(), 1e-5f);
  }
  EXPECT_LT((narrow.positions().cast<double>() - wide.positions()).abs().maxCoeff(), 1e-5);
}

}  // namespace
}  // namespace lockstep
