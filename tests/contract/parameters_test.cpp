// An environment with its own parameters moves like a model with those parameters. SPDX-License-Identifier: Apache-2.0
//
// Every declared parameter differs in every environment. The tests compare several steps with the reference, which
// shares no arithmetic with the kernels, and with a plan that is compiled from the changed model.
#include "contract.h"
#include "reference/random_bounds.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using contract::serial;
using Eigen::VectorXd;

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

// Frictions and limits per environment, by every engine: as in a plan of the changed model. Where the model has no
// friction, environments may have one.
class OwnBounds : public testing::TestWithParam<Method> {};

TEST_P(OwnBounds, act_like_those_of_a_model) {
  const ParameterSet fields = {Parameter::friction,     Parameter::position_limits, Parameter::velocity_limit,
                               Parameter::effort_limit, Parameter::stiffness,       Parameter::armature};
  constexpr int environments = 5;
  int changed = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Model model = physics::random_bounds(seed);
    StepSettings settings = contract::settings(GetParam(), fields);
    settings.record_impulses = false;
    settings.iterations = 40;
    const Plan plan = compile(model, settings);
    for (const Engine engine : {Engine::tables, Engine::automatic}) {
      SCOPED_TRACE(testing::Message() << "seed " << seed << ", " << to_string(engine));
      Batch<double> batch(plan, environments, {.threads = 1, .engine = engine});
      contract::Random random(seed);
      for (const Parameter field : {Parameter::friction, Parameter::velocity_limit, Parameter::effort_limit,
                                    Parameter::stiffness, Parameter::armature}) {
        auto rows = batch.parameter(field);
        for (int e = 1; e < environments; ++e)
          for (Eigen::Index row = 0; row < rows.rows(); ++row) rows(row, e) *= random.uniform(0.5, 2.0);
      }
      auto limits = batch.parameter(Parameter::position_limits);
      for (int e = 1; e < environments; ++e) {
        for (Eigen::Index row = 0; row < limits.rows(); ++row) limits(row, e) += row % 2 == 0 ? -0.002 * e : 0.002 * e;
        batch.parameter(Parameter::friction)(0, e) += 0.3;
        batch.parameter(Parameter::armature)(0, e) += 0.01;
        batch.parameter(Parameter::stiffness)(0, e) += 5.0;
      }
      std::vector<Model> models;
      for (int e = 0; e < environments; ++e) models.push_back(contract::model_of(batch, e));
      batch.step(3);
      for (int e = 0; e < environments; ++e) {
        settings.per_environment = {};
        Batch<double> alone(compile(models[static_cast<std::size_t>(e)], settings), 1,
                            {.threads = 1, .engine = Engine::tables});
        alone.step(3);
        ASSERT_EQ(batch.faults()[e], alone.faults()[0]) << e;
        EXPECT_LE((batch.velocities().col(e) - alone.velocities().col(0)).abs().maxCoeff(), 1e-7) << e;
        EXPECT_LE((batch.positions().col(e) - alone.positions().col(0)).abs().maxCoeff(), 1e-9) << e;
        EXPECT_NEAR(batch.limit_violations()(0, e), alone.limit_violations()(0, 0), 1e-9);
        if (e > 0) changed += (batch.velocities().col(e) - batch.velocities().col(0)).abs().maxCoeff() > 1e-3;
      }
    }
  }
  EXPECT_GE(changed, 300);
}

INSTANTIATE_TEST_SUITE_P(method, OwnBounds, testing::ValuesIn(physics::methods), physics::method_name);

// A rotor without mass is fixed to a heavy link; its inertia counts although no mass scales it.
TEST(OwnInertias, change_nothing_where_a_link_has_inertia_and_no_mass) {
  Model model = scenes::gripper13();
  model.links.push_back({"rotor", {}});
  model.links.back().inertia.about_center = Eigen::Vector3d(0.02, 0.02, 0.03).asDiagonal();
  Joint weld;
  weld.name = "weld", weld.parent = "l1", weld.child = "rotor";
  model.joints.push_back(weld);
  model.joints[0].velocity = model.joints[1].velocity = 1.0;
  StepSettings settings = contract::settings(Method::reduced);
  Batch<double> plain(compile(model, settings), 1, serial);
  for (const ParameterSet& fields : {ParameterSet{Parameter::center_of_mass}, ParameterSet{Parameter::inertia}}) {
    settings.per_environment = fields;
    Batch<double> own(compile(model, settings), 1, serial);
    EXPECT_NEAR(own.kinetic_energies()(0, 0), plain.kinetic_energies()(0, 0), 1e-12);
    Batch<double> twin(compile(model, contract::settings(Method::reduced)), 1, serial);
    own.step(20), twin.step(20);
    EXPECT_LE((own.velocities() - twin.velocities()).abs().maxCoeff(), 1e-10);
  }
}

TEST(OwnLimits, are_only_where_the_model_has_one_and_in_order) {
  Model model = scenes::gripper13();
  model.joints[0].lower = -1.0, model.joints[0].upper = 1.0, model.joints[1].velocity_limit = 3.0;
  model.joints[2].effort_limit = 2.0;
  StepSettings settings;
  settings.per_environment = {Parameter::position_limits, Parameter::velocity_limit, Parameter::effort_limit,
                              Parameter::inertia, Parameter::friction};
  Batch<float> batch(compile(model, settings), 8, serial);
  auto limits = batch.parameter(Parameter::position_limits);
  EXPECT_EQ(limits(0, 0), -1.0f);
  EXPECT_EQ(limits(2, 0), -std::numeric_limits<float>::infinity());
  limits(0, 1) = 0.5f, limits(1, 1) = 0.4f;                 // not in order
  batch.parameter(Parameter::velocity_limit)(0, 2) = 1.0f;  // the model has none there
  batch.parameter(Parameter::velocity_limit)(1, 3) = 0.0f;
  batch.parameter(Parameter::effort_limit)(2, 4) = -1.0f;
  batch.parameter(Parameter::inertia)(6 * 3 + 1, 5) *= 100.0f;  // larger than the sum of the others
  batch.parameter(Parameter::friction)(3, 6) = -0.1f;
  limits(1, 7) = std::numeric_limits<float>::infinity();  // is allowed
  batch.step();
  EXPECT_EQ(batch.faults()[0], Fault::none);
  for (int e = 1; e < 7; ++e) EXPECT_EQ(batch.faults()[e], Fault::bad_value) << e;
  EXPECT_EQ(batch.faults()[7], Fault::none);
  const char* const words[] = {
      "lower limit of joint 'j0' (position_limits, row 0) is 0.5, must be at most the upper limit, which is 0.4",
      "velocity limit of joint 'j0'",
      "velocity limit of joint 'j1'",
      "effort limit of joint 'j2'",
      "inertia of link 'l2' (inertia, row 18)",
      "friction of joint 'j3'"};
  for (int e = 1; e < 7; ++e)
    EXPECT_NE(batch.explain_fault(e).find(words[e - 1]), std::string::npos) << batch.explain_fault(e);
}

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
