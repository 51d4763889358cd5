// Parameters of one environment act like the numbers of a model. SPDX-License-Identifier: Apache-2.0
//
// The tests use random trees with random sets of declared parameters and change all of these in one environment of
// three. The reference steps a model with the changed numbers. Tolerances are those of agreement_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "lockstep/plan.h"
#include "physics.h"
#include "reference/step.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using physics::condition;
using physics::distance;
using physics::size;

constexpr int changed = 1, environments = 3;

// Changes the declared numbers of a model and of one environment alike.
class Changes {
 public:
  Changes(int seed, Batch<double>& batch, Model& model, reference::Inputs& inputs)
      : engine_(seed), batch_(batch), model_(model), inputs_(inputs) {}

  void apply() {
    int gear = 0, dof = 0;
    for (std::size_t c = 0; c < model_.couplings.size(); ++c) {
      Coupling& coupling = model_.couplings[c];
      const int row = static_cast<int>(c);
      for (CouplingTerm& term : coupling.terms) change(Parameter::gear_ratio, gear++, term.ratio, 0.8, 1.2);
      change(Parameter::offset, row, coupling.offset, 0.9, 1.1);
      std::visit([&](auto& softness) { change_softness(row, softness); }, coupling.softness);
      if (is_hard(coupling.softness)) soften(row, coupling);
    }
    for (Joint& joint : model_.joints) {
      if (!joint.moves()) continue;
      change(Parameter::drive_gains, 2 * dof, joint.drive.kp, 0.5, 2.0);
      change(Parameter::drive_gains, 2 * dof + 1, joint.drive.kd, 0.5, 2.0);
      change(Parameter::damping, dof, joint.damping, 0.5, 2.0);
      change(Parameter::armature, dof, joint.armature, 0.5, 2.0);
      change(Parameter::stiffness, dof++, joint.stiffness, 0.5, 2.0);
    }
    for (std::size_t l = 0; l < model_.links.size(); ++l) {
      Inertia& inertia = model_.links[l].inertia;
      const double before = inertia.mass;
      change(Parameter::mass, static_cast<int>(l), inertia.mass, 0.5, 2.0);
      if (before > 0.0 && !declared(Parameter::inertia)) inertia.about_center *= inertia.mass / before;
      const int link = static_cast<int>(l);
      for (int k = 0; k < 3; ++k) change(Parameter::center_of_mass, 3 * link + k, inertia.center[k], 0.5, 1.5);
      if (declared(Parameter::inertia)) inertia.about_center *= uniform(0.5, 2.0);
      const int rows[] = {0, 1, 2, 0, 0, 1}, columns[] = {0, 1, 2, 1, 2, 2};
      for (int k = 0; k < 6; ++k)
        change(Parameter::inertia, 6 * link + k, inertia.about_center(rows[k], columns[k]), 1.0, 1.0);
    }
    for (int k = 0; k < 3; ++k) change(Parameter::gravity, k, model_.gravity[k], -1.0, 1.0);
    for (Eigen::Index i = 0; i < inputs_.wrenches.size(); ++i) {
      double& component = inputs_.wrenches(i % 6, i / 6);  // six rows per link
      component = declared(Parameter::link_wrench) ? 1.0 : 0.0;
      change(Parameter::link_wrench, static_cast<int>(i), component, -1.0, 1.0);
    }
  }

 private:
  bool declared(Parameter parameter) const { return batch_.plan().settings().per_environment.contains(parameter); }
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  void change(Parameter parameter, int row, double& number, double low, double high) {
    if (!declared(parameter)) return;
    number *= uniform(low, high);
    batch_.parameter(parameter)(row, changed) = number;
  }
  void change_softness(int row, double& first, double& second) {
    change(Parameter::softness, 2 * row, first, 0.5, 1.0);
    change(Parameter::softness, 2 * row + 1, second, 0.5, 2.0);
  }
  void change_softness(int row, Hard& softness) {
    double cfm = 0.0;
    change_softness(row, softness.erp, cfm);
  }
  void change_softness(int row, ErpCfm& softness) { change_softness(row, softness.erp, softness.cfm); }
  void change_softness(int row, Spring& softness) { change_softness(row, softness.kp, softness.kd); }
  void change_softness(int row, Frequency& softness) {
    change_softness(row, softness.rad_per_s, softness.damping_ratio);
  }
  // The second row of a hard coupling is its cfm.
  void soften(int row, Coupling& coupling) {
    if (!declared(Parameter::softness) || uniform(0.0, 1.0) < 0.5) return;
    const ErpCfm softer{erp_of(coupling.softness), uniform(0.01, 1.0)};
    coupling.softness = softer;
    batch_.parameter(Parameter::softness)(2 * row + 1, changed) = softer.cfm;
  }

  std::mt19937_64 engine_;
  Batch<double>& batch_;
  Model& model_;
  reference::Inputs& inputs_;
};

ParameterSet some_parameters(int seed) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(seed));
  ParameterSet set;
  const auto chosen = engine() >> 32;
  for (unsigned p = 0; p < parameter_count; ++p)
    if (const Parameter parameter{p}; ((chosen >> p) & 1u) && parameter != Parameter::friction) set.insert(parameter);
  return set;
}

void expect_same_motion(const Batch<double>& batch, int environment, const Model& model,
                        const reference::Inputs& inputs) {
  SCOPED_TRACE("environment " + std::to_string(environment));
  StepSettings settings = batch.plan().settings();
  settings.method = batch.plan().method();
  const reference::Mechanism mechanism(model);
  const reference::Step next = reference::step(mechanism, settings, mechanism.initial_state(), inputs);
  MatrixXd k = next.stage.response;
  for (Eigen::Index r = 0; r < k.rows(); ++r) k(r, r) += next.stage.rows[r].cfm;
  const double kappa = condition(next.stage.implicit) * condition(k);
  const double rounding = std::max(1e-11, mechanism.velocities() * physics::epsilon * kappa);
  const reference::State ours = physics::state_of(batch, environment);
  EXPECT_LE(distance(ours.q, next.state.q), rounding * std::max(1.0, size(next.state.q)));
  EXPECT_LE(distance(ours.v, next.state.v), rounding * std::max(1.0, size(next.state.v)));
  const VectorXd impulses = batch.coupling_impulses().matrix().col(environment);
  const double momentum = std::max(size(next.stage.implicit) * std::max(1.0, size(next.state.v)), size(next.impulses));
  EXPECT_LE(distance(impulses, next.impulses), rounding * momentum);
}

class Parameters : public testing::TestWithParam<Method> {};

TEST_P(Parameters, act_in_one_environment_like_the_numbers_of_a_model) {
  scenes::RandomOptions options;
  options.redundant = false;  // the parameters decide which couplings are redundant: see RedundantCouplings
  options.springs = true;
  for (int seed = 0; seed < 500 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    StepSettings settings;
    settings.method = GetParam();
    settings.iterations = 1 + seed % 5;
    settings.velocity_iterations = seed % 3;
    settings.record_impulses = true;
    settings.per_environment = some_parameters(seed);
    Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    if (settings.method == Method::reduced && (settings.per_environment.contains(Parameter::softness) ||
                                               settings.per_environment.contains(Parameter::coupling_switch)))
      continue;
    const Plan plan = compile(model, settings);
    if (!plan.redundant_couplings().empty()) continue;
    Batch<double> batch(plan, environments, physics::by_turns(plan, seed));
    const Model original = model;
    reference::Inputs inputs = reference::Mechanism(model).initial_inputs();
    const reference::Inputs unchanged = inputs;
    Changes(seed, batch, model, inputs).apply();
    batch.step();
    expect_same_motion(batch, 0, original, unchanged);
    expect_same_motion(batch, changed, model, inputs);
    expect_same_motion(batch, 2, original, unchanged);
  }
}

INSTANTIATE_TEST_SUITE_P(method, Parameters, testing::ValuesIn(physics::methods), physics::method_name);

// Redundant couplings stay in the plan if ratios or softness may differ per environment. Each step then finds them by
// their pivots, and rounding in their impulses does not move the joints.
TEST(RedundantCouplings, keep_the_motion_with_gear_ratios_or_softness_per_environment) {
  for (const Parameter parameter : {Parameter::gear_ratio, Parameter::softness})
    for (int seed = 0; seed < 500 && !HasFailure(); ++seed) {
      SCOPED_TRACE(seed);
      const Model model = scenes::random_model(static_cast<std::uint64_t>(seed));
      StepSettings settings = physics::settings(Method::direct);
      Batch<double> without(compile(model, settings), 1, {.threads = 1, .engine = Engine::tables});
      if (without.plan().redundant_couplings().empty()) continue;
      settings.per_environment = {parameter};
      const Plan changed_plan = compile(model, settings);
      Batch<double> with(changed_plan, 1, physics::by_turns(changed_plan, seed));
      with.step(10), without.step(10);
      EXPECT_LE((with.positions() - without.positions()).abs().maxCoeff(), 1e-9);
      EXPECT_LE((with.velocities() - without.velocities()).abs().maxCoeff(), 1e-7);
    }
}

// With the ratios of the model, j0 = j4 follows from j0 = j2 and j2 = j4. With those of the second environment it does
// not.
TEST(RedundantCouplings, depend_on_the_gear_ratios_of_the_environment) {
  Model model = scenes::redundant();
  Batch<double> batch(compile(model, {.per_environment = {Parameter::gear_ratio}}), 2, {.threads = 1});
  ASSERT_EQ(batch.plan().method(), Method::direct);
  ASSERT_EQ(batch.plan().redundant_couplings(), std::vector<int>{2});
  batch.parameter(Parameter::gear_ratio)(2, 1) = -2.0;  // j0 = 2 j4, so the three joints must be at zero
  for (int joint : {0, 2, 4}) batch.positions()(joint, 1) = 0.0;
  for (int step = 0; step < 240; ++step) batch.step();
  EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-12);
  for (int joint : {0, 2, 4}) EXPECT_NEAR(batch.positions()(joint, 1), 0.0, 1e-12);

  Batch<double> shared(compile(model, {.method = Method::direct}), 1, {.threads = 1});
  for (int step = 0; step < 240; ++step) shared.step();
  EXPECT_LE((batch.positions().col(0) - shared.positions().col(0)).abs().maxCoeff(), 1e-10);
}

}  // namespace
}  // namespace lockstep
