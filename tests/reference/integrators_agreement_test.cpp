// Integrators of the kernels agree with those of the reference, step by step. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <optional>

#include "contract.h"
#include "lockstep/error.h"
#include "physics.h"
#include "plan/program.h"
#include "reference/integrators.h"
#include "reference/step.h"
#include "scenes/scenes.h"
#include "seeds.h"

namespace lockstep {
namespace {

using Eigen::VectorXd;
using physics::size;

const int seeds = seeds_of(300, 120);

StepSettings settings_of(Integrator integrator, int seed) {
  StepSettings settings;
  settings.guard = infinity;  // the formulas alone
  settings.integrator = integrator;
  settings.dt = seed % 3 == 0 ? 1.0 / 240 : 1.0 / 2000;
  settings.stage_inputs = seed % 2 == 0;
  // Runge-Kutta needs reduced; the others also take direct, which keeps hard couplings as rows.
  settings.method = seed % 5 == 0 && integrator != Integrator::runge_kutta ? Method::direct : Method::automatic;
  return settings;
}

// Inputs that change during a step.
void moving(double share, reference::Inputs& inputs) {
  for (Eigen::Index i = 0; i < inputs.efforts.size(); ++i) {
    const double phase = share + static_cast<double>(i);
    inputs.position_targets[i] += 0.3 * std::sin(3.0 * phase);
    inputs.velocity_targets[i] += 0.5 * std::cos(2.0 * phase);
    inputs.efforts[i] += 0.2 * std::sin(phase);
  }
}

void put(const reference::Inputs& inputs, std::size_t time, Batch<double>& batch) {
  const int dofs = batch.plan().dofs(), row = static_cast<int>(time) * dofs;
  batch.position_targets().col(0).segment(row, dofs) = inputs.position_targets.array();
  batch.velocity_targets().col(0).segment(row, dofs) = inputs.velocity_targets.array();
  batch.efforts().col(0).segment(row, dofs) = inputs.efforts.array();
}

// Number of solves in a step; each adds its rounding.
double solves(Integrator integrator) {
  return integrator == Integrator::leapfrog ? 5.0 : integrator == Integrator::extrapolated ? 15.0 : 4.0;
}

class IntegratorAgreement : public testing::TestWithParam<Integrator> {};

TEST_P(IntegratorAgreement, holds_for_states_after_each_of_three_steps) {
  int compared = 0, articulated = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    SCOPED_TRACE(seed);
    const bool deep = seed % 8 == 7;
    scenes::RandomOptions options;
    options.min_dofs = deep ? 24 : 1, options.max_dofs = deep ? 28 : 12;
    options.couplings = !deep || GetParam() != Integrator::runge_kutta;
    // Runge-Kutta takes no soft couplings, and drives and damping only if they are slow enough for an explicit step.
    options.drives = options.damping = GetParam() != Integrator::runge_kutta || seed % 2 == 0;
    options.soft = GetParam() == Integrator::runge_kutta ? scenes::RandomOptions::Soft::never
                                                         : scenes::RandomOptions::Soft::sometimes;
    const Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    StepSettings settings = settings_of(GetParam(), seed);
    if (deep && options.couplings) settings.method = Method::direct;
    std::optional<Plan> plan;
    try {
      plan = compile(model, settings);
    } catch (const SettingsError& refused) {  // only Runge-Kutta may refuse a model as too stiff
      ASSERT_EQ(GetParam(), Integrator::runge_kutta) << refused.what();
      continue;
    }
    ++compared;
    articulated += program_of(*plan).f64.articulated.used();
    const reference::Mechanism mechanism(model);
    Batch<double> batch(*plan, 1, physics::by_turns(*plan, seed));
    const std::vector<double> times = plan->stage_times();
    const auto set = [&](double share, reference::Inputs& inputs) {
      if (settings.stage_inputs) moving(share, inputs);
    };
    for (std::size_t time = 0; settings.stage_inputs && time < times.size(); ++time) {
      reference::Inputs inputs = mechanism.initial_inputs();
      set(times[time], inputs);
      put(inputs, time, batch);
    }
    reference::State state = mechanism.initial_state();
    double rounding = 0.0;
    for (int step = 0; step < 3; ++step) {
      const reference::Stage stage(mechanism, settings.dt, state, mechanism.initial_inputs());
      const double before = size(state.v);
      state = reference::integrated(mechanism, settings, state, set);
      batch.step();
      rounding += solves(GetParam()) *
                  std::max(1e-11, mechanism.velocities() * physics::epsilon * physics::condition(stage.implicit));
      const reference::State ours = physics::state_of(batch);
      const double moving_scale = std::max({1.0, before, size(state.v)});
      EXPECT_LE(physics::distance(ours.q, state.q), rounding * std::max(1.0, size(state.q))) << step;
      EXPECT_LE(physics::distance(ours.v, state.v), rounding * moving_scale) << step;
      physics::expect_same_poses(ours, state, rounding);
      for (const reference::RootPose& root : ours.roots) EXPECT_NEAR(root.orientation.norm(), 1.0, 1e-12);
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(compared, seeds / 3);
  EXPECT_GT(articulated, seeds / 40);
}

// All parameters of an environment act like those of a model with the same numbers. Softness is left out, because erp
// and cfm depend on the length of a stage.
TEST_P(IntegratorAgreement, holds_for_environments_with_their_own_parameters) {
  int compared = 0;
  for (int seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const bool explicitly = GetParam() == Integrator::runge_kutta, switches = seed % 2 == 1 && !explicitly;
    scenes::RandomOptions options;
    options.max_dofs = 10;
    options.redundant = false;
    options.drives = options.damping = !explicitly;
    if (explicitly) options.soft = scenes::RandomOptions::Soft::never;
    StepSettings settings;
    settings.guard = infinity;
    settings.integrator = GetParam();
    settings.method = switches ? Method::direct : Method::reduced;
    settings.dt = 1.0 / 480;
    const Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    for (unsigned p = 0; p < parameter_count; ++p)
      if (const Parameter parameter{p};
          parameter != Parameter::softness && (parameter != Parameter::coupling_switch || switches) &&
          parameter != Parameter::friction && (parameter != Parameter::drive_gains || options.drives) &&
          (parameter != Parameter::stiffness || !explicitly) &&
          // The ratios of the plan decide which joint Runge-Kutta moves to correct a coupling.
          (parameter != Parameter::gear_ratio || !explicitly))
        settings.per_environment.insert(parameter);
    const Plan plan = compile(model, settings);
    if (!plan.redundant_couplings().empty()) continue;
    Batch<double> batch(plan, 3, physics::by_turns(plan, seed));
    contract::scatter(batch, 1, static_cast<std::uint64_t>(seed));
    const Model own = contract::model_of(batch, 1);
    const reference::Mechanism mechanism(own);
    const Eigen::MatrixXd wrenches = contract::wrenches_of(batch, 1);
    reference::State state = mechanism.initial_state();
    const reference::Stage stage(mechanism, settings.dt, state, mechanism.initial_inputs());
    const Eigen::MatrixXd k = stage.response;
    state = reference::integrated(mechanism, settings, state,
                                  [&](double, reference::Inputs& inputs) { inputs.wrenches = wrenches; });
    batch.step();
    ++compared;
    const double rounding = solves(GetParam()) * std::max(1e-11, mechanism.velocities() * physics::epsilon *
                                                                     physics::condition(stage.implicit) *
                                                                     (k.size() > 0 ? physics::condition(k) : 1.0));
    const reference::State ours = physics::state_of(batch, 1);
    EXPECT_LE(physics::distance(ours.q, state.q), rounding * std::max(1.0, size(state.q)));
    EXPECT_LE(physics::distance(ours.v, state.v), rounding * std::max(1.0, size(state.v)));
  }
  EXPECT_GT(compared, seeds / 2);
}

INSTANTIATE_TEST_SUITE_P(integrator, IntegratorAgreement,
                         testing::Values(Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta),
                         [](const auto& info) { return std::string(to_string(info.param)); });

}  // namespace
}  // namespace lockstep
