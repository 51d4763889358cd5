// An environment with its own parameters moves like a model with those parameters. SPDX-License-Identifier: Apache-2.0
//
// Every declared parameter differs in every environment. The tests compare several steps with the reference, which
// shares no arithmetic with the kernels, and with a plan that is compiled from the changed model.
#include "contract.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using Eigen::VectorXd;

constexpr BatchOptions serial = {.threads = 1};

// How far another order of operations may change a step: the number of velocities times epsilon times the condition
// numbers of the two matrices that the step solves with (Higham 2002, section 10.1), and at least 1e-10.
double rounding(const reference::Stage& stage) {
  Eigen::MatrixXd k = stage.response;
  for (Eigen::Index r = 0; r < k.rows(); ++r) k(r, r) += stage.rows[static_cast<std::size_t>(r)].cfm;
  const double kappa = physics::condition(stage.implicit) * physics::condition(k);
  return std::max(1e-10, static_cast<double>(stage.state.v.size()) * physics::epsilon * kappa);
}

void expect_same_state(const reference::State& a, const reference::State& b, double tolerance) {
  EXPECT_LE(physics::distance(a.q, b.q), tolerance * std::max(1.0, physics::size(b.q)));
  EXPECT_LE(physics::distance(a.v, b.v), tolerance * std::max(1.0, physics::size(b.v)));
  physics::expect_same_poses(a, b, tolerance);
}

// Expects that the reference and a batch of `start` come to the state of one environment of `batch`. `start` is the
// model with the parameters and the start state of the environment; `batch` has made `steps` steps from it.
void expect_same_as_model(Batch<double>& batch, int environment, const Model& start, int steps) {
  SCOPED_TRACE("environment " + std::to_string(environment));
  StepSettings settings = batch.plan().settings();
  settings.method = batch.plan().method();
  const reference::Mechanism mechanism(start);
  reference::Inputs inputs = mechanism.initial_inputs();
  inputs.wrenches = contract::wrenches_of(batch, environment);
  reference::State state = mechanism.initial_state();
  double tolerance = 0.0;
  for (int i = 0; i < steps; ++i) {
    const reference::Step next = reference::step(mechanism, settings, state, inputs);
    state = next.state;
    tolerance += rounding(next.stage);
  }
  const reference::State ours = physics::state_of(batch, environment);
  expect_same_state(ours, state, tolerance);

  settings.per_environment = {Parameter::link_wrench};  // a model has no link wrenches
  Batch<double> recompiled(compile(start, settings), 1, {.threads = 1, .engine = Engine::tables});
  for (Eigen::Index i = 0; i < inputs.wrenches.size(); ++i)
    recompiled.parameter(Parameter::link_wrench)(i, 0) = inputs.wrenches(i % 6, i / 6);
  recompiled.step(steps);
  expect_same_state(ours, physics::state_of(recompiled), tolerance);
}

class OwnParameters : public testing::TestWithParam<Method> {};

TEST_P(OwnParameters, act_in_every_environment_like_those_of_a_model) {
  constexpr int environments = 3, steps = 4;
  scenes::RandomOptions options;
  options.redundant = false;  // the parameters decide which couplings are redundant: see RedundantPair
  for (std::uint64_t seed = 0; seed < 100 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    StepSettings settings = contract::settings(GetParam(), contract::all_parameters(GetParam()));
    settings.iterations = 1 + static_cast<int>(seed % 4);
    settings.velocity_iterations = static_cast<int>(seed % 3);
    const Model model = scenes::random_model(seed, options);
    const Plan plan = compile(model, settings);
    Batch<double> batch =
        contract::scattered<double>(plan, environments, physics::by_turns(plan, static_cast<int>(seed)));
    std::vector<Model> starts;
    for (int e = 0; e < environments; ++e) starts.push_back(contract::model_of(batch, e));
    batch.step(steps);
    ASSERT_EQ(batch.faulted(), 0);
    for (int e = 0; e < environments; ++e) expect_same_as_model(batch, e, starts[static_cast<std::size_t>(e)], steps);
  }
}

TEST_P(OwnParameters, change_nothing_where_they_keep_the_models_values) {
  scenes::RandomOptions options;
  options.redundant = false;
  for (std::uint64_t seed = 200; seed < 240 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const Model model = scenes::random_model(seed, options);
    const StepSettings settings = contract::settings(GetParam(), contract::all_parameters(GetParam()));
    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, 2, physics::by_turns(plan, static_cast<int>(seed)));
    const Model start = contract::model_of(batch, 1);
    batch.step(2);
    expect_same_as_model(batch, 1, start, 2);
  }
}

INSTANTIATE_TEST_SUITE_P(method, OwnParameters, testing::ValuesIn(physics::methods), physics::method_name);

class OwnSoftness : public testing::TestWithParam<Method> {};

// The lanes of one tile: couplings as in the model, a softer one, a spring of zero stiffness, a frequency of zero.
TEST_P(OwnSoftness, switches_a_coupling_off_where_it_is_zero) {
  for (const bool driven : {false, true}) {
    Model model = scenes::chain8();
    model.couplings[1].softness = Spring{80.0, 2.0};
    model.couplings[2].softness = Frequency{25.0, 0.7};
    if (driven) model.joints[3].drive = {30.0, 1.0, 0.4, 0.0};
    Batch<double> batch =
        contract::scattered<double>(compile(model, contract::settings(GetParam(), {Parameter::softness})), 4);
    auto softness = batch.parameter(Parameter::softness);
    softness(2, 1) = 7.0;                   // softer
    softness(2, 2) = softness(3, 2) = 0.0;  // kp = kd = 0
    softness(4, 3) = 0.0;                   // mu = 0
    std::vector<Model> starts;
    for (int e = 0; e < 4; ++e) starts.push_back(contract::model_of(batch, e));
    batch.step(6);
    for (int e = 0; e < 4; ++e) expect_same_as_model(batch, e, starts[static_cast<std::size_t>(e)], 6);
    EXPECT_LE(std::abs(batch.coupling_impulses()(1, 2)), 1e-25) << "a coupling that is off takes no impulse";
    EXPECT_LE(std::abs(batch.coupling_impulses()(2, 3)), 1e-25);
    EXPECT_GT(std::abs(batch.coupling_impulses()(1, 1)), 1e-9);
  }
}

// The second number of a hard coupling is its cfm; the coupling is hard where that is zero.
TEST_P(OwnSoftness, softens_a_hard_coupling_in_some_environments) {
  Batch<double> batch(compile(scenes::chain8(), contract::settings(GetParam(), {Parameter::softness})), 2, serial);
  for (int c = 0; c < 4; ++c) batch.parameter(Parameter::softness)(2 * c + 1, 1) = 50.0;
  std::vector<Model> starts = {contract::model_of(batch, 0), contract::model_of(batch, 1)};
  batch.step(20);
  for (int e : {0, 1}) expect_same_as_model(batch, e, starts[static_cast<std::size_t>(e)], 20);
  EXPECT_GT(batch.coupling_errors().col(1).abs().maxCoeff(), batch.coupling_errors().col(0).abs().maxCoeff());
}

INSTANTIATE_TEST_SUITE_P(method, OwnSoftness, testing::Values(Method::pgs, Method::tgs, Method::direct),
                         physics::method_name);

// The model has one coupling twice. Each environment gives both the same ratio, so one follows from the other.
TEST(RedundantPair, leaves_one_coupling_without_impulse_for_any_ratio) {
  Model model = scenes::chain8();
  model.couplings.push_back(model.couplings[1]);
  const StepSettings settings = contract::settings(Method::direct, {Parameter::gear_ratio});
  const Plan plan = compile(model, settings);
  ASSERT_EQ(plan.redundant_couplings(), std::vector<int>{4});
  Batch<double> pair(plan, 3, serial), single(compile(scenes::chain8(), settings), 3, serial);
  const double ratios[] = {-1.0, -1.3, 0.7};
  for (int e = 0; e < 3; ++e) {
    pair.parameter(Parameter::gear_ratio)(1, e) = ratios[e];
    pair.parameter(Parameter::gear_ratio)(4, e) = ratios[e];
    single.parameter(Parameter::gear_ratio)(1, e) = ratios[e];
  }
  for (int step = 0; step < 10; ++step) {
    pair.step(), single.step();
    const auto of_pair = pair.coupling_impulses(), of_single = single.coupling_impulses();
    for (int e = 0; e < 3; ++e) {
      expect_same_state(physics::state_of(pair, e), physics::state_of(single, e), 1e-10);
      EXPECT_NEAR(of_pair(1, e) + of_pair(4, e), of_single(1, e), 1e-10);
      EXPECT_TRUE(of_pair(1, e) == 0.0 || of_pair(4, e) == 0.0);
    }
  }
}

}  // namespace
}  // namespace lockstep
