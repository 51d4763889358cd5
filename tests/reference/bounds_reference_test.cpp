// Bounds in the reference against closed formulas. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "physics.h"
#include "reference/step.h"

namespace lockstep::reference {
namespace {

using physics::methods;
using physics::sliders;

constexpr double h = 1.0 / 240, g = 9.81;

// A slider of 2 kg.
struct Slider {
  Slider() : model(sliders({2.0})), joint(model.joints[0]) {}
  Slider(const Slider&) = delete;

  State after(Method method, int steps = 1, int iterations = 4, int velocity_iterations = 1) const {
    const Mechanism mechanism(model);
    State state = mechanism.initial_state();
    const StepSettings settings = physics::settings(method, iterations, velocity_iterations, h);
    for (int n = 0; n < steps; ++n) state = step(mechanism, settings, state, mechanism.initial_inputs()).state;
    return state;
  }

  // Expects this position and velocity after one step of every method.
  void expect(double q, double v, double tolerance = 1e-12) const {
    for (const Method method : methods) {
      const State state = after(method);
      EXPECT_NEAR(state.q[0], q, tolerance) << to_string(method);
      EXPECT_NEAR(state.v[0], v, tolerance) << to_string(method);
    }
  }

  Model model;
  Joint& joint;
};

TEST(ReferenceFriction, holds_up_to_its_threshold_and_brakes_with_it_beyond) {
  Slider body;
  body.model.gravity = {-g, 0, 0};
  body.joint.friction = 1.01 * 2.0 * g;
  for (const Method method : methods) {
    EXPECT_NEAR(body.after(method, 240).q[0], 0.0, 1e-15);
    EXPECT_NEAR(body.after(method, 240).v[0], 0.0, 1e-15);
  }
  body.joint.friction = 0.99 * 2.0 * g;
  // One sub-step, because tgs moves by the mean of the velocities of its sub-steps.
  for (const Method method : methods) {
    const State state = body.after(method, 1, 1);
    EXPECT_NEAR(state.v[0], -0.01 * g * h, 1e-15) << to_string(method);
    EXPECT_NEAR(state.q[0], -0.01 * g * h * h, 1e-15);
    EXPECT_NEAR(body.after(method, 240).v[0], -0.01 * g, 1e-12) << to_string(method);
  }
}

TEST(ReferenceFriction, stops_a_body_in_the_time_that_it_takes) {
  Slider body;
  body.joint.velocity = 1.0;
  body.joint.friction = 3.0;  // 1.5 m/s^2: 160 steps
  for (const Method method : methods) {
    EXPECT_NEAR(body.after(method, 100).v[0], 1.0 - 100 * 1.5 * h, 1e-12);
    EXPECT_NEAR(body.after(method, 161).v[0], 0.0, 1e-14) << to_string(method);
  }
}

TEST(ReferenceLimit, acts_in_the_step_that_would_pass_it_and_not_before) {
  Slider body;
  body.joint.velocity = 1.0;
  body.joint.upper = 1.5 * h;
  for (const Method method : methods) {
    EXPECT_NEAR(body.after(method, 1).v[0], 1.0, 1e-14);
    EXPECT_NEAR(body.after(method, 2).q[0], 1.5 * h, 1e-14) << to_string(method);
    EXPECT_NEAR(body.after(method, 3).q[0], 1.5 * h, 1e-14) << to_string(method);
    EXPECT_NEAR(body.after(method, 3).v[0], 0.0, 1e-13) << to_string(method);
  }
  for (const Method method : {Method::pgs, Method::direct, Method::reduced})  // the rest of the way in one step
    EXPECT_NEAR(body.after(method, 2).v[0], 0.5, 1e-12) << to_string(method);
}

TEST(ReferenceLimit, corrects_its_share_of_a_violation_and_leaves_no_velocity) {
  Slider body;
  body.joint.position = -0.3, body.joint.velocity = -2.0;
  body.joint.lower = -0.1;
  body.joint.limit_softness = Hard{0.25};
  // tgs is left out: its limits forget their impulse after each sub-step, so they cannot remove what a correction has
  // left in the velocity.
  for (const Method method : {Method::pgs, Method::direct, Method::reduced}) {
    const State state = body.after(method), single = body.after(method, 1, 4, 0);
    EXPECT_NEAR(state.q[0], -0.25, 1e-12) << to_string(method);
    EXPECT_NEAR(state.v[0], 0.0, 1e-12) << to_string(method);
    EXPECT_NEAR(single.q[0], -0.25, 1e-12);
    EXPECT_NEAR(single.v[0], 0.05 / h, 1e-12);
  }
}

TEST(ReferenceLimit, returns_its_share_of_the_speed) {
  for (const double side : {1.0, -1.0}) {
    Slider body;
    body.joint.velocity = side;
    (side > 0.0 ? body.joint.upper : body.joint.lower) = 0.5 * h * side;
    body.joint.restitution = 0.7;
    body.expect(0.5 * h * side, -0.7 * side);
  }
}

TEST(ReferenceLimit, sags_by_the_force_that_it_bears_if_it_is_soft) {
  Slider body;
  body.joint.effort = 6.0;
  body.joint.upper = 0.01;
  for (const Softness& softness : std::vector<Softness>{Spring{300.0, 30.0}, Frequency{std::sqrt(150.0), 0.6}}) {
    body.joint.limit_softness = softness;
    for (const Method method : methods) {
      const State rest = body.after(method, 1500);
      EXPECT_NEAR(rest.q[0], 0.01 + 6.0 / 300.0, 1e-10) << to_string(method);
    }
  }
  // One step from beyond the limit: m (v' - v) = h F - h (kp (C + h v') + kd v').
  body.joint.position = 0.05, body.joint.velocity = 0.3;
  body.joint.limit_softness = Spring{300.0, 30.0};
  const double v = (2.0 * 0.3 + h * 6.0 - h * 300.0 * 0.04) / (2.0 + h * (h * 300.0 + 30.0));
  for (const Method method : {Method::pgs, Method::direct, Method::reduced}) {
    EXPECT_NEAR(body.after(method).v[0], v, 1e-13);
    EXPECT_NEAR(body.after(method).q[0], 0.05 + h * v, 1e-13);
  }
}

TEST(ReferenceVelocityLimit, clamps_whatever_drives_the_joint) {
  Slider body;
  body.joint.velocity_limit = 0.5;
  body.joint.velocity = 0.4;
  body.joint.effort = 1000.0;
  for (const Method method : methods) EXPECT_NEAR(body.after(method).v[0], 0.5, 1e-13);
  body.joint.drive.kinematic = true, body.joint.drive.position_target = 1.0;
  body.expect(0.5 * h, 0.5);
}

TEST(ReferenceEffortLimit, makes_the_force_of_a_servo_constant) {
  Slider body;
  body.joint.drive.kp = 1000.0, body.joint.drive.position_target = 1.0, body.joint.drive.kd = 10.0;
  body.joint.effort = 3.0;  // the limit applies to servo plus effort (M63)
  body.joint.effort_limit = 5.0;
  for (const Method method : {Method::pgs, Method::direct, Method::reduced})
    for (const int velocity_iterations : {0, 1}) {
      const State state = body.after(method, 1, 4, velocity_iterations);
      EXPECT_NEAR(state.v[0], h * 5.0 / 2.0, 1e-14);
      EXPECT_NEAR(state.q[0], h * h * 5.0 / 2.0, 1e-14);
    }
  body.joint.effort_limit = 1e4;
  Slider free;
  free.joint = body.joint;
  free.joint.effort_limit = infinity;
  for (const Method method : methods)
    EXPECT_NEAR(body.after(method, 10).v[0], free.after(method, 10).v[0], 1e-12) << to_string(method);
}

TEST(ReferenceEffortLimit, clamps_an_effort_without_servo) {
  Slider body;
  body.joint.effort = -3.0, body.joint.effort_limit = 1.0;
  for (const Method method : methods) EXPECT_NEAR(body.after(method).v[0], -h / 2.0, 1e-15);
}

TEST(ReferenceKinematicDrive, moves_its_joint_to_the_target_against_any_force) {
  Slider body;
  body.joint.velocity = 3.0, body.joint.effort = 50.0, body.joint.friction = 2.0, body.joint.effort_limit = 0.1;
  body.joint.drive.kinematic = true;
  body.joint.drive.position_target = 0.02, body.joint.drive.velocity_target = 0.6;
  body.expect(0.02, 0.02 / h);  // Hard{1} covers the whole distance
  body.joint.drive.softness = Hard{0.25};
  const double k = 0.6 + 0.25 * (0.02 - h * 0.6) / h;
  for (const Method method : {Method::pgs, Method::direct, Method::reduced}) {
    EXPECT_NEAR(body.after(method).v[0], k, 1e-12);
    EXPECT_NEAR(body.after(method).q[0], h * k, 1e-13);
  }
  EXPECT_NEAR(body.after(Method::tgs).q[0], h * k, 1e-13);  // the sub-steps share the erp
  body.joint.drive.softness = Hard{1.0};
  body.joint.upper = 0.01;  // limits take precedence
  body.expect(0.01, 0.01 / h);
}

TEST(ReferenceKinematicDrive, acts_like_a_spring_to_the_moving_target_if_it_is_soft) {
  Slider body;
  body.joint.velocity = 0.1;
  body.joint.drive.kinematic = true;
  body.joint.drive.position_target = 0.02, body.joint.drive.velocity_target = 0.6;
  body.joint.drive.softness = Spring{400.0, 20.0};
  // A servo and a soft kinematic drive have the same force: kp (q_t - q') + kd (v_t - v').
  Slider servo;
  servo.joint.velocity = 0.1;
  servo.joint.drive = {400.0, 20.0, 0.02, 0.6};
  const State same = servo.after(Method::direct);
  for (const Method method : {Method::pgs, Method::direct, Method::reduced})
    EXPECT_NEAR(body.after(method).v[0], same.v[0], 1e-13) << to_string(method);
}

TEST(ReferenceForceLimit, lets_a_coupling_slip_at_its_limit) {
  Model model = sliders({1.0, 1.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0)};
  model.joints[0].effort = 10.0;
  for (const Softness& softness : std::vector<Softness>{Hard{}, Spring{1e6, 1e4}})
    for (const Method method : methods) {
      const StepSettings settings = physics::settings(method, 1);
      model.couplings[0].softness = softness;
      model.couplings[0].force_limit = 4.0;
      const Mechanism slipping(model);
      const Step slips = step(slipping, settings, slipping.initial_state(), slipping.initial_inputs());
      model.couplings[0].force_limit = 6.0;
      const Mechanism holding(model);
      const Step holds = step(holding, settings, holding.initial_state(), holding.initial_inputs());
      model.couplings[0].force_limit = infinity;
      const Mechanism plain(model);
      const Step free = step(plain, settings, plain.initial_state(), plain.initial_inputs());
      EXPECT_NEAR(holds.state.v[0], free.state.v[0], 1e-12) << to_string(method);
      EXPECT_NEAR(holds.impulses[0], free.impulses[0], 1e-12);
      if (!is_hard(softness)) continue;  // the spring has not reached its limit after one step
      EXPECT_NEAR(slips.state.v[0], 6.0 * h, 1e-13) << to_string(method);
      EXPECT_NEAR(slips.state.v[1], 4.0 * h, 1e-13);
      EXPECT_NEAR(slips.impulses[0], -4.0 * h, 1e-13);
    }
}

// If a leader and its follower both stick, their velocity is determined, but not the friction of either.
TEST(ReferenceFriction, adds_up_over_coupled_joints) {
  Model model = sliders({1.0, 1.0});
  model.couplings = {Coupling::mimic("s0", "s1", -2.0)};
  model.joints[0].friction = 1.0, model.joints[1].friction = 2.0;
  for (const double effort : {1.9, 2.1}) {  // on the follower; together they hold 1 + 2 / 2
    model.joints[0].effort = effort;
    const Mechanism mechanism(model);
    for (const Method method : {Method::direct, Method::reduced}) {
      const State state =
          step(mechanism, physics::settings(method), mechanism.initial_state(), mechanism.initial_inputs()).state;
      const double expected = effort < 2.0 ? 0.0 : (effort - 2.0) * h / (1.0 + 0.25);
      EXPECT_NEAR(state.v[0], expected, 1e-14);
      EXPECT_NEAR(state.v[1], expected / 2.0, 1e-14);
    }
  }
}

// In reduced, friction of a follower does not resist the correction of its position (M59).
TEST(ReferenceFriction, does_not_resist_the_correction_of_a_follower_in_reduced) {
  Model model = sliders({1.0, 1.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.01)};
  model.joints[0].friction = 1e3;
  const Mechanism mechanism(model);
  const auto moved = [&](Method method) {
    return step(mechanism, physics::settings(method), mechanism.initial_state(), mechanism.initial_inputs()).state.q;
  };
  EXPECT_NEAR(moved(Method::reduced)[0], -0.2 * 0.01, 1e-14);
  EXPECT_NEAR(moved(Method::reduced)[1], 0.0, 1e-14);
  EXPECT_NEAR(moved(Method::direct)[0], 0.0, 1e-14);
  EXPECT_NEAR(moved(Method::direct)[1], 0.2 * 0.01, 1e-14);
}

TEST(ReferenceKinematicDrive, is_refused_if_it_contradicts_another) {
  Model model = sliders({1.0, 1.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0)};
  for (int j = 0; j < 2; ++j) model.joints[j].drive.kinematic = true;
  model.joints[0].drive.position_target = 0.1;
  const Mechanism mechanism(model);
  for (const Method method : {Method::direct, Method::reduced})
    EXPECT_THROW(step(mechanism, physics::settings(method), mechanism.initial_state(), mechanism.initial_inputs()),
                 std::logic_error);
}

}  // namespace
}  // namespace lockstep::reference
