// Tendons in the kernels agree with the scalar reference, which knows them as rows over all joints.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "lockstep/error.h"
#include "physics.h"
#include "random_bounds.h"
#include "reference/integrators.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using physics::distance;
using physics::size;

constexpr double close = 1e-8;

void expect_same(const Batch<double>& batch, const reference::State& theirs, double tolerance) {
  EXPECT_EQ(batch.faults()[0], Fault::none);
  const reference::State ours = physics::state_of(batch);
  EXPECT_LE(distance(ours.v, theirs.v), tolerance * std::max(1.0, size(theirs.v))) << "v";
  EXPECT_LE(distance(ours.q, theirs.q), tolerance * std::max(1.0, size(theirs.q))) << "q";
  physics::expect_same_poses(ours, theirs, tolerance);
}

scenes::RandomOptions with_tendons(int seed) {
  scenes::RandomOptions options;
  options.max_dofs = 9, options.springs = true, options.max_tendons = 3;
  options.coupling_error = seed / 4 % 2 == 0;
  return options;
}

// The inertia that a natural frequency refers to has no armature of tendons, and their speed is that of independent
// joints where followers' velocities have an error. The reference knows neither.
void arm(Model& model) {
  const bool by_frequency = std::any_of(model.couplings.begin(), model.couplings.end(), [](const Coupling& coupling) {
    return std::holds_alternative<Frequency>(coupling.softness);
  });
  for (std::size_t j = 0; j < model.joints.size(); ++j)
    if (model.joints[j].kind == JointKind::tendon && !by_frequency)
      model.joints[j].armature = 0.02 * static_cast<double>(j % 4);
}

void expect_same_step(const Model& model, const StepSettings& settings, int seed) {
  const Plan plan = compile(model, settings);
  const reference::Mechanism mechanism(model);
  Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
  batch.step();
  const reference::Step theirs =
      reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
  expect_same(batch, theirs.state, close);
}

TEST(TendonAgreement, holds_after_a_step_of_euler) {
  for (int seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    scenes::RandomOptions options = with_tendons(seed);
    if (seed % 4 == 0) options.max_trees = 4;
    Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    if (!options.coupling_error) arm(model);
    StepSettings settings = physics::settings(Method::reduced, 1, seed / 2 % 2);
    settings.integrator = Integrator::euler;
    settings.record_impulses = seed % 2 == 0;
    expect_same_step(model, settings, seed);
    if (HasFailure()) return;
  }
}

TEST(TendonAgreement, holds_for_bounds_after_a_step_of_euler) {
  int limited = 0;
  for (int seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    const scenes::RandomOptions options = with_tendons(seed);
    Model model = physics::random_bounds(static_cast<std::uint64_t>(seed), 1.0 / 240, options);
    for (Joint& joint : model.joints) {
      if (joint.kind != JointKind::tendon) continue;
      if (options.coupling_error) joint.restitution = 0.0;  // of the speed before the step
      limited += joint.lower > -infinity || joint.upper < infinity;
    }
    StepSettings settings = physics::settings(Method::reduced, 1, seed / 2 % 2);
    settings.integrator = Integrator::euler;
    expect_same_step(model, settings, seed);
    if (HasFailure()) return;
  }
  EXPECT_GT(limited, 100);
}

class TendonIntegrator : public testing::TestWithParam<Integrator> {};

TEST_P(TendonIntegrator, agrees_for_two_steps) {
  int compared = 0;
  for (int seed = 0; seed < 200; ++seed) {
    SCOPED_TRACE(seed);
    const bool explicitly = GetParam() == Integrator::runge_kutta;
    scenes::RandomOptions options = with_tendons(seed);
    options.drives = options.damping = options.springs = !explicitly || seed % 2 == 0;
    if (explicitly) options.soft = scenes::RandomOptions::Soft::never, options.coupling_error = false;
    Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    if (!options.coupling_error) arm(model);
    StepSettings settings;
    settings.guard = infinity;
    settings.integrator = GetParam();
    settings.method = Method::reduced;
    settings.dt = 1.0 / 2000;
    std::optional<Plan> plan;
    try {
      plan = compile(model, settings);
    } catch (const SettingsError& refused) {
      ASSERT_TRUE(explicitly) << refused.what();
      continue;
    }
    ++compared;
    const reference::Mechanism mechanism(model);
    Batch<double> batch(*plan, 1, physics::by_turns(*plan, seed));
    reference::State state = mechanism.initial_state();
    for (int step = 0; step < 2; ++step) {
      state = reference::integrated(mechanism, settings, state, [](double, reference::Inputs&) {});
      batch.step();
      expect_same(batch, state, close);
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(compared, 60);
}

INSTANTIATE_TEST_SUITE_P(each, TendonIntegrator,
                         testing::Values(Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta),
                         [](const auto& info) { return std::string(to_string(info.param)); });

}  // namespace
}  // namespace lockstep
