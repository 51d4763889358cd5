// Soft couplings that are folded into the matrix. SPDX-License-Identifier: Apache-2.0
//
// The reference solves them as rows beside the bounds. Tolerances are those of bounds_agreement_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "contract.h"
#include "lockstep/import.h"
#include "lockstep/plan.h"
#include "physics.h"
#include "plan/program.h"
#include "random_bounds.h"
#include "reference/bounded.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using physics::distance;
using physics::size;

constexpr double close = 1e-12;

const Tables<double>& tables_of(const Plan& plan) { return program_of(plan).f64; }
bool folds(const Plan& plan) { return tables_of(plan).folded.count > 0; }
// Whether bounds are held as single velocities, and none is a slot.
bool by_velocity_alone(const Plan& plan) {
  const Tables<double>& t = tables_of(plan);
  return t.rounds.used() && t.rounds.slots.count == 0;
}

// A random mechanism with hard bounds. Its couplings are soft and without a force limit; with `some_hard` every second
// one is hard.
Model soft_model(int seed, bool some_hard) {
  Model model = physics::random_bounds(static_cast<std::uint64_t>(seed));
  int number = 0;
  for (Coupling& coupling : model.couplings) {
    coupling.force_limit = infinity;
    const bool hard = some_hard && ++number % 2 == 0;
    if (hard) coupling.softness = Hard{0.5};
    if (!hard && is_hard(coupling.softness)) coupling.softness = Frequency{20.0 + seed % 50, 0.2 * (seed % 7)};
  }
  for (Joint& joint : model.joints) {
    if (!is_hard(joint.limit_softness)) joint.limit_softness = Hard{0.3};
    if (joint.drive.kinematic) joint.drive.softness = Hard{0.8};
  }
  return model;
}

StepSettings settings_of(Method method, int seed) {
  StepSettings settings = physics::settings(method, 4, seed % 5 == 0 ? 0 : 1);
  settings.record_impulses = seed % 2 == 0;
  settings.record_diagnostics = seed % 3 == 0;
  return settings;
}

// Steps one environment as the reference does. `rounding` grows with the condition of the couplings' matrix.
void expect_agreement(const Batch<double>& batch, int environment, const Model& model, double tolerance) {
  const reference::Mechanism mechanism(model);
  StepSettings settings = batch.plan().settings();
  settings.method = batch.plan().method();
  const reference::Step theirs =
      reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
  const reference::State ours = physics::state_of(batch, environment);
  const double moving = std::max({1.0, size(mechanism.initial_state().v), size(theirs.state.v)});
  EXPECT_EQ(batch.faults()[environment], Fault::none);
  EXPECT_LE(distance(ours.v, theirs.state.v), tolerance * moving) << "v";
  EXPECT_LE(distance(ours.q, theirs.state.q), tolerance * std::max(1.0, size(theirs.state.q))) << "q";
  physics::expect_same_poses(ours, theirs.state, tolerance);
  if (!settings.record_impulses) return;
  const Eigen::VectorXd impulses = batch.coupling_impulses().matrix().col(environment);
  const double momentum = std::max(size(theirs.stage.implicit) * moving, size(theirs.impulses));
  for (int c = 0; c < impulses.size(); ++c)
    if (!is_hard(model.couplings[static_cast<std::size_t>(c)].softness)) {
      EXPECT_NEAR(impulses[c], theirs.impulses[c], tolerance * momentum) << "impulse " << c;
    }
}

class Folding : public testing::TestWithParam<Method> {};

TEST_P(Folding, agrees_with_rows_of_the_reference_without_bounds) {
  int folded = 0;
  for (int seed = 0; seed < 600 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const Model model = soft_model(seed, GetParam() == Method::reduced);
    StepSettings settings = settings_of(GetParam(), seed);
    Model unbounded = model;
    for (Joint& joint : unbounded.joints) {
      joint.lower = -infinity, joint.upper = infinity, joint.friction = 0.0;
      joint.velocity_limit = joint.effort_limit = infinity;
      if (joint.drive.kinematic) joint.drive = {};
    }
    const Plan plan = compile(unbounded, settings);
    if (!folds(plan)) continue;
    ++folded;
    EXPECT_EQ(tables_of(plan).rows.count, 0);
    Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
    batch.step();
    const reference::Mechanism mechanism(unbounded);
    const reference::Stage stage(mechanism, settings.dt, mechanism.initial_state(), mechanism.initial_inputs());
    const double rounding = mechanism.velocities() * physics::epsilon * physics::condition(stage.implicit);
    expect_agreement(batch, 0, unbounded, std::max(close, rounding));
  }
  EXPECT_GT(folded, 200);
}

TEST_P(Folding, agrees_with_rows_of_the_reference_beside_bounds) {
  int folded = 0, by_velocity = 0;
  for (int seed = 0; seed < 600 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const Model model = soft_model(seed, GetParam() == Method::reduced);
    const Plan plan = compile(model, settings_of(GetParam(), seed));
    if (!folds(plan)) continue;
    ++folded, by_velocity += by_velocity_alone(plan);
    Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
    batch.step();
    try {
      expect_agreement(batch, 0, model, 1e-8);
    } catch (const std::logic_error&) {  // the reference found no choice of servos at their limits
    }
  }
  EXPECT_GT(folded, 200);
  EXPECT_GT(by_velocity, 150);
}

INSTANTIATE_TEST_SUITE_P(method, Folding, testing::Values(Method::direct, Method::reduced), physics::method_name);

// A gripper with soft couplings and targets that drive it against its bounds.
Model soft_gripper() {
  Model model = import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model;
  for (Coupling& coupling : model.couplings) coupling.softness = Frequency{60.0, 1.0};
  for (Joint& joint : model.joints)
    if (joint.moves()) joint.drive.kp = 8.0, joint.drive.kd = 0.3;
  return model;
}

const StepSettings euler{.integrator = Integrator::euler};

TEST(FoldingSearch, holds_velocities_in_the_folded_matrix) {
  const Plan plan = compile(soft_gripper(), euler);
  EXPECT_TRUE(folds(plan));
  EXPECT_TRUE(by_velocity_alone(plan));
  EXPECT_NE(plan.describe().find("soft couplings are folded into the matrix"), std::string::npos) << plan.describe();
}

template <class S>
void expect_same_bits_alone() {
  const Plan plan = compile(soft_gripper(), euler);
  for (const Engine engine : physics::engines()) {
    const BatchOptions options{.threads = 1, .engine = engine};
    Batch<S> together = contract::scattered<S>(plan, 37, options);
    for (int step = 0; step < 20; ++step) together.step();
    for (const int e : {0, 5, 18, 36}) {
      Batch<S> alone(plan, 1, options);
      contract::scatter(alone, 0, static_cast<std::uint64_t>(e));
      for (int step = 0; step < 20; ++step) alone.step();
      EXPECT_TRUE(contract::same_bits(together, e, alone, 0)) << to_string(engine);
    }
  }
}

TEST(FoldingSearch, has_the_same_bits_alone_and_beside_others) {
  expect_same_bits_alone<float>();
  expect_same_bits_alone<double>();
}

// One step from the same state.
TEST(FoldingSearch, differs_little_between_precisions_and_engines) {
  const Plan plan = compile(soft_gripper(), euler);
  for (const Engine engine : physics::engines()) {
    Batch<double> exact = contract::scattered<double>(plan, 64, {.threads = 1, .engine = Engine::tables});
    Batch<float> single(plan, 64, {.threads = 1, .engine = engine});
    Batch<double> other(plan, 64, {.threads = 1, .engine = engine});
    exact.step(10);
    const auto copy = [&]<class S>(Batch<S>& batch) {
      batch.positions() = exact.positions().template cast<S>(),
      batch.velocities() = exact.velocities().template cast<S>();
      batch.position_targets() = exact.position_targets().template cast<S>();
      batch.velocity_targets() = exact.velocity_targets().template cast<S>();
      batch.efforts() = exact.efforts().template cast<S>();
    };
    copy(single), copy(other);
    exact.step(), single.step(), other.step();
    const double moving = 1.0 + exact.velocities().abs().maxCoeff();
    EXPECT_LE((single.velocities().cast<double>() - exact.velocities()).abs().maxCoeff(), 3e-5 * moving);
    EXPECT_LE((other.velocities() - exact.velocities()).abs().maxCoeff(), 1e-12 * moving);
  }
}

// Two joints on a line, coupled by a spring whose share (M97) of the lighter one's inertia is given.
Model two_sliders(double share, bool bounded) {
  Model model = physics::sliders({0.2, 1.0});
  constexpr double dt = 1.0 / 240;
  model.couplings.push_back(Coupling::mimic("s0", "s1", -0.5, 0.01, Spring{0.0, share * 0.2 / dt}));
  model.joints[0].velocity = 0.7, model.joints[1].velocity = -0.2;
  for (Joint& joint : model.joints) joint.drive.kp = 30.0, joint.drive.position_target = 0.4;
  if (bounded)
    for (Joint& joint : model.joints) joint.lower = -1e3, joint.upper = 1e3, joint.effort_limit = 1e5;
  return model;
}

TEST(FoldingRule, is_the_share_of_the_lightest_inertia) {
  for (const bool bounded : {false, true})
    for (const double share : {1.0, 999.0, 1001.0}) {
      const Model model = two_sliders(share, bounded);
      for (const Method method : {Method::direct, Method::reduced, Method::pgs}) {
        SCOPED_TRACE(std::string(to_string(method)) + " " + std::to_string(share));
        const Plan plan = compile(model, physics::settings(method, 200));
        EXPECT_EQ(folds(plan), method != Method::pgs && share < 1000.0);
        Batch<double> batch(plan, 1, {.threads = 1});
        batch.step();
        expect_agreement(batch, 0, model, method == Method::pgs ? 1e-8 : close);
      }
    }
}

TEST(FoldingRule, says_what_stands_against_it) {
  const auto obstacle = [](const Model& model, const StepSettings& settings) {
    const Plan plan = compile(model, settings);
    EXPECT_FALSE(folds(plan));
    return find_obstacle(program_of(plan), Axis::folding)->reason;
  };
  const auto contains = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  const Model model = two_sliders(1.0, false);
  EXPECT_TRUE(contains(obstacle(two_sliders(1e4, false), euler), "'s0' is so stiff"));
  EXPECT_TRUE(contains(obstacle(model, {.integrator = Integrator::leapfrog}), "several stages"));
  StepSettings settings = euler;
  settings.per_environment = {Parameter::softness};
  EXPECT_TRUE(contains(obstacle(model, settings), "the softness differs"));
  settings.per_environment = {Parameter::coupling_switch};
  EXPECT_TRUE(contains(obstacle(model, settings), "switched per environment"));
  Model hard = physics::sliders({1.0, 1.0, 1.0});
  hard.couplings.push_back(Coupling::mimic("s0", "s1", -1.0, 0.0, Spring{10.0, 0.1}));
  hard.couplings.push_back(Coupling::mimic("s2", "s1", -1.0));
  settings = euler;
  EXPECT_TRUE(folds(compile(hard, settings)));
  settings.method = Method::direct;
  EXPECT_TRUE(contains(obstacle(hard, settings), "'s2' is hard"));
}

// Two pairs on trees of their own. The second one is soft, too stiff, or hard.
TEST(FoldingRule, holds_for_each_component_by_itself) {
  const std::pair<Softness, int> cases[] = {{Spring{0.0, 1e4}, 0}, {Spring{0.0, 1e6}, 1}, {Hard{0.5}, 1}};
  for (const auto& [second, rows] : cases)
    for (const bool bounded : {false, true})
      for (const Engine engine : physics::engines()) {
        Model model = physics::sliders({0.2, 1.0, 0.3, 0.8});
        model.links.push_back({"other base", {}});
        model.roots = {{"base", false}, {"other base", false}};
        model.joints[2].parent = model.joints[3].parent = "other base";
        model.couplings.push_back(Coupling::mimic("s0", "s1", -0.5, 0.01, Frequency{30.0, 0.5}));
        model.couplings.push_back(Coupling::mimic("s2", "s3", 0.7, 0.0, second));
        for (Joint& joint : model.joints)
          joint.velocity = 0.7, joint.drive.kp = 30.0, joint.drive.position_target = 0.4;
        if (bounded)
          for (Joint& joint : model.joints) joint.velocity_limit = 0.3;
        StepSettings settings = physics::settings(Method::direct);
        settings.record_impulses = settings.record_diagnostics = true;
        const Plan plan = compile(model, settings);
        EXPECT_EQ(tables_of(plan).rows.count, rows);
        EXPECT_EQ(tables_of(plan).folded.count, 2 - rows);
        EXPECT_EQ(plan.describe().find("1 soft coupling is folded into the matrix.\n") != std::string::npos, rows == 1);
        Batch<double> batch(plan, 1, {.threads = 1, .engine = engine});
        batch.step();
        expect_agreement(batch, 0, model, bounded ? 1e-9 : close);
        EXPECT_LE(batch.row_residuals().abs().maxCoeff(), 1e-12);
      }
}

// Ratios and offsets of one environment act like those of a model.
TEST(FoldingParameters, act_in_one_environment_like_the_numbers_of_a_model) {
  int folded = 0;
  for (const Method method : {Method::direct, Method::reduced})
    for (int seed = 0; seed < 200 && !testing::Test::HasFailure(); ++seed) {
      SCOPED_TRACE(seed);
      Model model = soft_model(seed, method == Method::reduced);
      for (Joint& joint : model.joints) joint.effort_limit = infinity;
      StepSettings settings = settings_of(method, seed);
      settings.per_environment = {Parameter::gear_ratio, Parameter::offset};
      if (!compile(model, physics::settings(Method::direct)).redundant_couplings().empty()) continue;
      const Plan plan = compile(model, settings);
      if (!folds(plan) || !by_velocity_alone(plan)) continue;
      ++folded;
      Batch<double> batch(plan, 2, physics::by_turns(plan, seed));
      contract::Random random(static_cast<std::uint64_t>(seed));
      const Model original = model;
      int gear = 0, row = 0;
      for (Coupling& coupling : model.couplings) {
        for (CouplingTerm& term : coupling.terms)
          batch.parameter(Parameter::gear_ratio)(gear++, 1) = term.ratio *= random.uniform(0.8, 1.2);
        batch.parameter(Parameter::offset)(row++, 1) = coupling.offset += random.uniform(-0.01, 0.01);
      }
      batch.step();
      try {
        expect_agreement(batch, 0, original, 1e-8);
        expect_agreement(batch, 1, model, 1e-8);
      } catch (const std::logic_error&) {  // bounds and couplings of this model contradict each other
      }
    }
  EXPECT_GT(folded, 40);
}

}  // namespace
}  // namespace lockstep
