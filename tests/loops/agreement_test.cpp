// Loops of the kernels agree with those of the reference, step by step. SPDX-License-Identifier: Apache-2.0
#include "loop_runs.h"
#include "physics.h"
#include "reference/step.h"
#include "reference/truth.h"

namespace lockstep {
namespace {

using namespace loop_models;
using namespace loop_runs;
using physics::distance;
using physics::state_of;

struct Case {
  Model model;
  double effort;     // N m or N, at random
  double tolerance;  // of velocities, as a share of the fastest
};

// From each state that the batch reaches, both make the same step.
void expect_agreement(const Case& of) {
  const Plan plan = compile(of.model, settings(Integrator::euler));
  const reference::Mechanism mechanism(plan.model());
  Batch<double> batch(plan, 1, {.threads = 1});
  std::mt19937 random(5);
  for (int i = 0; i < 150; ++i) {
    if (i % 10 == 0) act_differently(batch, random, of.effort);
    const reference::State before = state_of(batch);
    reference::Inputs inputs = mechanism.initial_inputs();
    inputs.efforts = batch.efforts().col(0).matrix();
    batch.step(1);
    const reference::State after = state_of(batch),
                           expected = reference::step(mechanism, plan.settings(), before, inputs).state;
    const double speed = 1.0 + expected.v.lpNorm<Eigen::Infinity>();
    ASSERT_LT(distance(after.v, expected.v), of.tolerance * speed) << of.model.name << ", step " << i;
    ASSERT_LT(distance(after.q, expected.q), of.tolerance * speed / 240.0 + 1e-13) << of.model.name << ", step " << i;
    physics::expect_same_poses(after, expected, of.tolerance * speed / 240.0 + 1e-13);
  }
}

// A four-bar whose crank is a function of a cam's angle.
Model cam_drive() {
  Model model = four_bar({.start = {0.5, 6.1}});
  model.name = "cam_drive";
  add(model, "cam", Inertia::box(0.5, {0.1, 0.1, 0.1}, Vector3d::Zero()), JointKind::revolute, "ground",
      loop_models::at(Vector3d(0.0, 0.2, 0.0)), loop_models::turning, 0.4, 5.0);
  model.couplings = {Coupling::cam("crank", "cam", Polynomial{{0.076, 0.9, 0.4}})};
  return model;
}

std::vector<Case> cases() {
  return {{four_bar(), 0.5, 1e-9},
          {four_bar({.kind = LoopKind::hinge}), 0.5, 1e-9},
          {four_bar({.loops = 2}), 0.5, 1e-9},
          {slider_crank(), 0.3, 1e-9},
          {slider_crank(LoopKind::slider), 0.3, 1e-9},
          {stewart(), 3.0, 1e-9},
          {bar_on_arms(), 1.0, 1e-7},
          {gripper(), 0.002, 1e-8},
          {cam_drive(), 0.2, 1e-9}};
}

TEST(LoopAgreement, holds_for_steps_of_euler) {
  for (const Case& of : cases()) expect_agreement(of);
}

// The largest error of all positions and velocities after a quarter of a second.
double error_after(const Model& model, const reference::State& truth, Integrator integrator, int steps) {
  Batch<double> batch(compile(model, settings(integrator, 0.25 / steps)), 1, {.threads = 1});
  batch.step(steps);
  const reference::State reached = state_of(batch);
  return std::max(distance(reached.q, truth.q), distance(reached.v, truth.v));
}

// Against the exact motion, found in the null space of the rows.
TEST(LoopAgreement, with_the_exact_motion_is_of_first_and_second_order) {
  const struct {
    Model model;
    int steps;  // of the longer ones, which are short against springs
  } motions[] = {{four_bar(), 240}, {slider_crank(LoopKind::slider), 240}, {stewart(), 480}, {gripper(), 1920}};
  for (const auto& [model, steps] : motions) {
    const reference::Mechanism mechanism(model);
    const reference::State truth =
        reference::integrate(mechanism, mechanism.initial_state(), reference::held, 0.25, 1, 1500).end;
    for (const auto& [integrator, order] : {std::pair{Integrator::euler, 1.0}, std::pair{Integrator::leapfrog, 2.0}}) {
      const double longer = error_after(model, truth, integrator, steps),
                   shorter = error_after(model, truth, integrator, 2 * steps);
      EXPECT_NEAR(std::log2(longer / shorter), order, 0.15) << model.name << " by " << to_string(integrator);
    }
  }
}

}  // namespace
}  // namespace lockstep
