// Integrators of the reference against theory and exact motion. SPDX-License-Identifier: Apache-2.0
#include "reference/integrators.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lockstep/error.h"
#include "physics.h"
#include "reference/couplings.h"
#include "reference/truth.h"
#include "scenes/scenes.h"

namespace lockstep::reference {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr Integrator all[] = {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta};

StepSettings settings(Integrator integrator, double dt) {
  StepSettings result;
  result.integrator = integrator;
  result.dt = dt;
  return result;
}

constexpr double duration = 0.125;  // s, of all motions

// The state after `steps` steps. Inputs are those at the time of each stage, or those at the start of the step.
State run(const Mechanism& mechanism, Integrator integrator, int steps, const InputsOverTime& inputs,
          bool held_over_steps = false) {
  const double dt = duration / steps;
  State state = mechanism.initial_state();
  for (int n = 0; n < steps; ++n)
    state = integrated(mechanism, settings(integrator, dt), state, [&](double share, Inputs& acting) {
      inputs((n + (held_over_steps ? 0.0 : share)) * dt, acting);
    });
  return state;
}

VectorXd numbers(const State& state) {
  VectorXd result(7 + state.q.size() + state.v.size());
  result << state.roots[0].position, state.roots[0].orientation.coeffs(), state.q, state.v;
  return result;
}

State exact(const Mechanism& mechanism, const InputsOverTime& inputs) {
  return integrate(mechanism, mechanism.initial_state(), inputs, duration, 1, 1024).end;
}

// log2 of the factor by which halving the step reduces the error of the whole state. `steps` is the number of the
// larger steps.
double order(const Mechanism& mechanism, Integrator integrator, int steps, const InputsOverTime& inputs,
             bool held_over_steps = false) {
  const VectorXd truth = numbers(exact(mechanism, inputs));
  const auto error = [&](int count) {
    return (numbers(run(mechanism, integrator, count, inputs, held_over_steps)) - truth).norm();
  };
  return std::log2(error(steps) / error(2 * steps));
}

// The order in theory. `extrapolated` would be of fourth order if the leapfrog were symmetric in time, but two terms in
// h^4 of a step are not. v_m of (M67) is predicted and not the mean of v and v'. The Runge-Kutta method of the linear
// terms is not symmetric, so q_m differs from q' - h / 2 v'.
double theory(Integrator integrator) {
  return integrator == Integrator::leapfrog ? 2.0 : integrator == Integrator::extrapolated ? 3.0 : 4.0;
}

// Four links on a fixed or floating base with different axes.
Model four_links(bool floating) {
  Model model;
  model.links = {{"base", physics::link_box(0.3)}};
  const Eigen::Vector3d axes[] = {{0, 1, 0}, {0, 0, 1}, {0.6, 0.8, 0}, {0, 0.6, 0.8}};
  for (int i = 0; i < 4; ++i) {
    Joint& joint = physics::append_link(model, i == 0 ? "base" : model.links.back().name,
                                        {i == 0 && !floating ? 0.0 : 0.1, 0, 0}, axes[i]);
    joint.position = 0.3 - 0.2 * i;
    joint.velocity = 1.0 + i;
  }
  model.roots = {{model.links[0].name, floating}};
  return model;
}

// Four links with drives and soft couplings. The fastest rates, about 50 /s, are those of the damping, so the steps of
// the tests are small for them.
Model driven() {
  Model model = four_links(false);
  for (Joint& joint : model.joints) {
    joint.damping = 0.005;
    joint.armature = 0.001;
    joint.drive = {1.0, 0.01, 0.1, 0.0};
  }
  model.couplings = {Coupling::mimic("j0", "j2", -0.5, 0.1, Spring{2.0, 0.02}),
                     Coupling::mimic("j1", "j3", 1.0, 0.0, Frequency{20.0, 0.3})};
  return model;
}

void moving_inputs(double t, Inputs& inputs) {
  for (int i = 0; i < inputs.position_targets.size(); ++i) {
    inputs.position_targets[i] = 0.5 * std::sin(10.0 * t + i);
    inputs.velocity_targets[i] = 5.0 * std::cos(10.0 * t + i);
    inputs.efforts[i] = 0.1 * std::sin(15.0 * t - i);
  }
  inputs.wrenches.col(4) << 0.01, 0.02, -0.01, 0.3, -0.2, 0.1;
}

// Four floating links, which satisfy their couplings at the start in position and velocity.
Model floating_links() {
  Model model = four_links(true);
  model.gravity.setZero();
  model.roots[0].velocity << 3.0, -2.0, 1.0, 0.5, 0.3, -0.4;
  model.couplings = {Coupling::mimic("j2", "j0", -0.5), Coupling::mimic("j3", "j1", 0.8)};
  model.joints[2].position = 0.5 * model.joints[0].position;
  model.joints[2].velocity = 0.5 * model.joints[0].velocity;
  model.joints[3].position = -0.8 * model.joints[1].position;
  model.joints[3].velocity = -0.8 * model.joints[1].velocity;
  return model;
}

class IntegratorOrder : public testing::TestWithParam<Integrator> {};

TEST_P(IntegratorOrder, holds_for_a_damped_chain_with_hard_couplings) {
  EXPECT_NEAR(order(Mechanism(scenes::chain8()), GetParam(), 64, held), theory(GetParam()), 0.15);
}

TEST_P(IntegratorOrder, holds_for_springs_and_drives_with_moving_targets) {
  EXPECT_NEAR(order(Mechanism(driven()), GetParam(), 32, moving_inputs), theory(GetParam()), 0.15);
}

TEST_P(IntegratorOrder, holds_for_a_floating_mechanism_and_its_momentum) {
  const Mechanism mechanism(floating_links());
  EXPECT_NEAR(order(mechanism, GetParam(), 64, held), theory(GetParam()), 0.15);
  const Vector6d start = mechanism.momentum(mechanism.initial_state());
  const auto momentum_error = [&](int steps) {
    return (mechanism.momentum(run(mechanism, GetParam(), steps, held)) - start).norm();
  };
  EXPECT_GT(std::log2(momentum_error(32) / momentum_error(64)), theory(GetParam()) - 0.15);
}

INSTANTIATE_TEST_SUITE_P(integrator, IntegratorOrder, testing::ValuesIn(all),
                         [](const auto& info) { return std::string(to_string(info.param)); });

TEST(Leapfrog, is_of_first_order_where_targets_are_held_over_steps) {
  EXPECT_NEAR(order(Mechanism(driven()), Integrator::leapfrog, 32, moving_inputs, true), 1.0, 0.15);
}

// A pendulum has neither velocity-dependent forces nor linear terms, so the leapfrog is symmetric.
TEST(Extrapolated, is_of_fourth_order_where_the_leapfrog_is_symmetric) {
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, {0, 1, 0}).velocity = 5.0;
  EXPECT_NEAR(order(Mechanism(model), Integrator::extrapolated, 8, held), 4.0, 0.15);
}

// The growth function: the matrix by which a step of length 1 multiplies y, for y' = z y.
Matrix2d growth(Integrator integrator, const Matrix2d& z) {
  const Matrix2d one = Matrix2d::Identity();
  if (integrator == Integrator::runge_kutta) return one + z * (one + z / 2 * (one + z / 3 * (one + z / 4)));
  if (integrator == Integrator::extrapolated) {
    const Matrix2d half = growth(Integrator::leapfrog, z / 2);
    return (4 * half * half - growth(Integrator::leapfrog, z)) / 3;
  }
  // Alexander's method is the only one of third order that has a triple pole and is zero at infinity.
  const double g = 0.43586652150845899942;
  const Matrix2d above = one + (1 - 3 * g) * z + (0.5 - 3 * g + 3 * g * g) * z * z;
  const Matrix2d pole = (one - g * z).inverse();
  return pole * pole * pole * above;
}

TEST(LinearTerms, follow_the_growth_function_of_the_integrator) {
  for (const bool coupling : {false, true}) {
    Model model = physics::sliders({2.0});
    Joint& joint = model.joints[0];
    joint.position = 0.3;
    joint.velocity = -0.7;
    joint.armature = 0.5;
    joint.damping = 3.0;
    double kp = 900.0, kd = 4.0;
    if (coupling) {  // to a second slider with the opposite velocity, which doubles the stretch
      model = physics::sliders({2.0, 2.0});
      for (Joint& j : model.joints) j.armature = 0.5, j.damping = 3.0;
      model.joints[0].position = 0.3, model.joints[1].position = -0.3;
      model.joints[0].velocity = -0.7, model.joints[1].velocity = 0.7;
      model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.0, Spring{kp / 2, kd / 2})};
    } else {
      joint.drive = {kp, kd, 0.0, 0.0};
    }
    const Mechanism mechanism(model);
    for (const Integrator integrator : all) {
      const double h = 0.02;
      Matrix2d rates;
      rates << 0.0, 1.0, -kp / 2.5, -(kd + 3.0) / 2.5;
      const Vector2d expected = growth(integrator, h * rates) * Vector2d(0.3, -0.7);
      const State end =
          integrated(mechanism, settings(integrator, h), mechanism.initial_state(), [](double, Inputs&) {});
      EXPECT_NEAR(end.q[0], expected[0], 1e-13) << to_string(integrator) << coupling;
      EXPECT_NEAR(end.v[0], expected[1], 1e-12) << to_string(integrator) << coupling;
    }
  }
}

// A step of the leapfrog removes the share erp of the error; two half steps remove it twice.
TEST(HardCouplings, correct_their_share_of_the_error) {
  Model model = floating_links();
  const double erp = 0.3;
  for (Coupling& coupling : model.couplings) coupling.softness = Hard{erp}, coupling.offset = 0.01;
  const Mechanism mechanism(model);
  const State start = mechanism.initial_state();
  const Couplings couplings(mechanism);
  const double remaining = 1.0 - erp;
  for (const Integrator integrator : all) {
    const double share =
        integrator == Integrator::extrapolated ? (4.0 * remaining * remaining - remaining) / 3.0 : remaining;
    const State end = integrated(mechanism, settings(integrator, 0.01), start, [](double, Inputs&) {});
    EXPECT_LT((couplings.error(end.q) - share * couplings.error(start.q)).norm(), 1e-13) << to_string(integrator);
    EXPECT_LT((couplings.velocity_jacobian() * end.v).norm(), 1e-12) << to_string(integrator);
  }
}

TEST(HardCouplings, are_satisfied_by_a_leapfrog_that_starts_from_inconsistent_velocities) {
  Model model = floating_links();
  model.joints[2].velocity += 1.0;
  const Mechanism mechanism(model);
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated}) {
    const State end =
        integrated(mechanism, settings(integrator, 0.01), mechanism.initial_state(), [](double, Inputs&) {});
    EXPECT_LT((Couplings(mechanism).velocity_jacobian() * end.v).norm(), 1e-12) << to_string(integrator);
    EXPECT_LT(Couplings(mechanism).error(end.q).norm(), 1e-13) << to_string(integrator);
  }
}

// Each stage corrects the error of its own velocity: 1, 1/2, 3/4 and 1/4 of the error at the start.
TEST(HardCouplings, keep_three_eighths_of_a_velocity_error_in_runge_kutta) {
  Model model = floating_links();
  model.joints[2].velocity += 1.0;
  const Mechanism mechanism(model);
  const State end = integrated(mechanism, settings(Integrator::runge_kutta, 0.001), mechanism.initial_state(),
                               [](double, Inputs&) {});
  const VectorXd speed = Couplings(mechanism).velocity_jacobian() * end.v;
  EXPECT_NEAR(speed[0], 0.375, 1e-12);
  EXPECT_NEAR(speed[1], 0.0, 1e-12);
}

TEST(ReferenceIntegrators, refuse_integrators_of_first_order) {
  const Mechanism mechanism(floating_links());
  for (const Integrator integrator : {Integrator::automatic, Integrator::euler})
    EXPECT_THROW(integrated(mechanism, settings(integrator, 0.01), mechanism.initial_state(), [](double, Inputs&) {}),
                 SettingsError);
}

}  // namespace
}  // namespace lockstep::reference
