// Ball joints in the kernels agree with the reference, which has rotation matrices and dense Jacobians.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "model/rotations.h"
#include "physics.h"
#include "plan/program.h"
#include "random_bounds.h"
#include "reference/integrators.h"
#include "reference/step.h"
#include "scenes/scenes.h"
#include "seeds.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using physics::distance;
using physics::size;

const int seeds = seeds_of(400, 120);

// Some joints of a random model become balls.
Model with_balls(Model model, std::uint64_t seed, bool bounded, bool stiff) {
  physics::Uniform uniform{std::mt19937_64(1000 + seed)};
  const auto chance = [&](double probability) { return uniform(0.0, 1.0) < probability; };
  std::set<std::string> coupled;
  for (const Coupling& coupling : model.couplings) {
    coupled.insert(coupling.joint);
    for (const CouplingTerm& term : coupling.terms) coupled.insert(term.joint);
  }
  const std::vector<Joint> before = model.joints;
  model.joints.clear();
  for (const Joint& joint : before) {
    const bool turns = joint.kind == JointKind::revolute || joint.kind == JointKind::continuous;
    if (!turns || coupled.count(joint.name) > 0 || !chance(0.7)) {
      model.joints.push_back(joint);
      continue;
    }
    const int first = model.add_ball(joint.name, joint.parent, joint.child, joint.origin);
    const Vector3d direction = Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized();
    const double angle = chance(0.2) ? 0.0 : chance(0.3) ? uniform(3.0, 3.14) : uniform(0.0, 3.0);
    for (int k = 0; k < 3; ++k) {
      Joint& part = model.joints[static_cast<std::size_t>(first + k)];
      part.position = angle * direction[k];
      part.velocity = uniform(-2.0, 2.0);
      part.damping = joint.damping, part.armature = joint.armature * (k + 1), part.effort = uniform(-0.1, 0.1);
      if (stiff) {
        part.stiffness = joint.stiffness, part.drive = joint.drive;
        part.drive.kinematic = false, part.drive.softness = Hard{1.0};
        part.drive.position_target = uniform(-0.5, 0.5);
      }
      if (!bounded) continue;
      if (chance(0.2)) part.friction = uniform(0.0, 0.5);
      if (chance(0.2)) part.velocity_limit = uniform(0.5, 3.0);
    }
    Joint& part = model.joints[static_cast<std::size_t>(first)];
    if (bounded && chance(0.6)) {
      const double wrapped = std::min(angle, 2.0 * M_PI - angle);
      part.upper = std::max(0.01, wrapped + uniform(-0.01, 0.02));
      if (chance(0.3))
        part.limit_softness = Spring{uniform(10.0, 200.0), uniform(0.1, 2.0)};
      else if (chance(0.4))
        part.restitution = uniform(0.0, 1.0);
    }
  }
  return model;
}

// Positions of balls are the same turn if they differ by 2 pi along themselves.
VectorXd wrapped(const reference::Mechanism& mechanism, VectorXd q) {
  for (int dof = 0; dof < mechanism.dofs(); ++dof) {
    if (mechanism.joint(dof).kind != JointKind::ball) continue;
    const Vector3d vector = q.segment<3>(dof);
    const Eigen::Quaterniond turn = turned_by(vector);
    q.segment<3>(dof) = turn.w() < 0.0 ? Vector3d(-turn.vec()) : Vector3d(turn.vec());
    dof += 2;
  }
  return q;
}

int balls_of(const Model& model) {
  int balls = 0;
  for (const Joint& joint : model.joints) balls += joint.kind == JointKind::ball;
  return balls / 3;
}

void expect_same(const reference::Mechanism& mechanism, const Batch<double>& batch, const reference::State& exact,
                 double tolerance) {
  EXPECT_EQ(batch.faults()[0], Fault::none);
  const reference::State ours = physics::state_of(batch);
  const double moving = std::max({1.0, size(mechanism.initial_state().v), size(exact.v)});
  EXPECT_LE(distance(ours.v, exact.v), tolerance * moving) << "v";
  EXPECT_LE(distance(wrapped(mechanism, ours.q), wrapped(mechanism, exact.q)), tolerance * std::max(1.0, size(exact.q)))
      << "q";
  physics::expect_same_poses(ours, exact, tolerance);
  for (int dof = 0; dof < mechanism.dofs(); ++dof)
    if (mechanism.joint(dof).kind == JointKind::ball) {
      EXPECT_LE(ours.q.segment<3>(dof).norm(), M_PI + 1e-9);
      dof += 2;
    }
}

class BallsByMethod : public testing::TestWithParam<Method> {};

TEST_P(BallsByMethod, agree_after_one_step_beside_couplings_and_bounds) {
  int balls = 0, compared = 0;
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    scenes::RandomOptions options = scenes::forests();
    options.max_trees = 2, options.max_dofs = 6;
    const Model model = with_balls(scenes::random_model(static_cast<std::uint64_t>(seed), options),
                                   static_cast<std::uint64_t>(seed), seed % 2 == 1, true);
    const reference::Mechanism mechanism(model);
    const StepSettings settings = physics::settings(GetParam(), 1 + seed % 4, seed / 4 % 3);
    std::optional<reference::Step> theirs;
    try {
      theirs = reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
    } catch (const std::logic_error&) {  // bounds that contradict each other
      continue;
    }
    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
    batch.step();
    expect_same(mechanism, batch, theirs->state, 1e-8);
    balls += balls_of(model), ++compared;
  }
  EXPECT_GT(balls, seeds / 2);
  EXPECT_GT(compared, seeds / 2);
}

INSTANTIATE_TEST_SUITE_P(Methods, BallsByMethod, testing::ValuesIn(physics::methods), physics::method_name);

class BallsByIntegrator : public testing::TestWithParam<Integrator> {};

TEST_P(BallsByIntegrator, agree_after_each_of_three_steps) {
  int balls = 0, compared = 0;
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    scenes::RandomOptions options;
    options.max_dofs = 8;
    const bool explicitly = GetParam() == Integrator::runge_kutta;
    options.springs = !explicitly;
    options.drives = options.damping = !explicitly || seed % 2 == 0;
    options.soft = explicitly ? scenes::RandomOptions::Soft::never : scenes::RandomOptions::Soft::sometimes;
    const Model model = with_balls(scenes::random_model(static_cast<std::uint64_t>(seed), options),
                                   static_cast<std::uint64_t>(seed), false, !explicitly);
    StepSettings settings;
    settings.guard = infinity;
    settings.integrator = GetParam();
    settings.dt = seed % 3 == 0 ? 1.0 / 240 : 1.0 / 2000;
    std::optional<Plan> plan;
    try {
      plan = compile(model, settings);
    } catch (const SettingsError&) {
      ASSERT_TRUE(explicitly);
      continue;
    }
    const reference::Mechanism mechanism(model);
    Batch<double> batch(*plan, 1, physics::by_turns(*plan, seed));
    reference::State state = mechanism.initial_state();
    for (int step = 0; step < 3; ++step) {
      state = reference::integrated(mechanism, settings, state, [](double, reference::Inputs&) {});
      batch.step();
      expect_same(mechanism, batch, state, 1e-8);
    }
    balls += balls_of(model), ++compared;
  }
  EXPECT_GT(balls, seeds / 2);
  EXPECT_GT(compared, seeds / 3);
}

INSTANTIATE_TEST_SUITE_P(Integrators, BallsByIntegrator,
                         testing::Values(Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta),
                         [](const auto& info) { return to_string(info.param); });

}  // namespace
}  // namespace lockstep
