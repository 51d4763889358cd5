// Readbacks of bounds: shapes, names, refusals, sums over substeps. SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "bounded_scenes.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::scattered;
using contract::serial;

StepSettings recording(Method method) {
  StepSettings settings = contract::settings(method);
  settings.record_diagnostics = true;
  return settings;
}

class BoundsReadback : public testing::TestWithParam<Method> {};

// In the documented order: couplings, then the bounds of each dof.
std::vector<std::string> expected_names(const Model& model, const Ignored& ignore) {
  std::vector<std::string> names;
  for (const std::string& coupling : coupling_names(model)) names.push_back("coupling " + coupling);
  for (const Joint& joint : model.joints) {
    if (!joint.moves()) continue;
    const bool ranged = joint.lower > -infinity || joint.upper < infinity;
    if (ranged && ignore.position_limits.empty()) names.push_back("position limit " + joint.name);
    if (joint.velocity_limit < infinity && ignore.velocity_limits.empty())
      names.push_back("velocity limit " + joint.name);
    if (joint.friction > 0.0 && ignore.friction.empty()) names.push_back("friction " + joint.name);
    if (joint.drive.kinematic) names.push_back("kinematic drive " + joint.name);
    const bool limited = joint.effort_limit < infinity && !joint.drive.kinematic;
    if (limited && ignore.effort_limits.empty()) names.push_back("effort limit " + joint.name);
  }
  return names;
}

TEST_P(BoundsReadback, has_a_row_for_each_name_in_the_order_of_couplings_and_dofs) {
  for (const bool ignore : {false, true})
    for (Model model : contract::bounded_scenes()) {
      model.couplings.push_back(model.couplings[0]);  // redundant, with the same first joint
      std::swap(model.joints[1], model.joints[4]);    // the model's order is not that of the tree
      StepSettings settings = recording(GetParam());
      settings.ignore = {ignore, ignore, ignore, ignore};
      const Plan plan = compile(model, settings);
      EXPECT_EQ(plan.row_names(), expected_names(model, settings.ignore));
      auto batch = scattered<float>(plan, 11);
      for (int i = 0; i < 2; ++i, batch.step()) {
        EXPECT_EQ(batch.row_residuals().rows(), static_cast<Eigen::Index>(plan.row_names().size()));
        EXPECT_EQ(batch.row_states().rows(), static_cast<Eigen::Index>(plan.row_names().size()));
        EXPECT_EQ(batch.energy_balances().rows(), 4);
        EXPECT_EQ(batch.limit_violations().rows(), 1);
        EXPECT_EQ(batch.speeds().rows(), 1);
        for (const auto& rows : {batch.row_residuals(), batch.row_states(), batch.energy_balances(),
                                 batch.limit_violations(), batch.speeds()}) {
          EXPECT_EQ(rows.cols(), 11);
          EXPECT_TRUE(rows.isFinite().all());
        }
        EXPECT_TRUE((batch.row_residuals() >= 0.0f).all());
        EXPECT_TRUE((batch.row_states().abs() <= 2.0f).all());
      }
    }
}

TEST_P(BoundsReadback, refuses_diagnostics_that_are_not_recorded) {
  const Model model = contract::bounded(scenes::chain8());
  const Batch<double> batch(compile(model, contract::settings(GetParam())), 3, serial);
  const auto expect_refused = [](auto act, const std::string& element, const std::string& remedy) {
    try {
      act();
      FAIL() << "accepted: " << element;
    } catch (const UsageError& error) {
      EXPECT_EQ(error.element(), element);
      EXPECT_NE(error.remedy().find(remedy), std::string::npos) << error.what();
    }
  };
  const std::string remedy = "StepSettings::record_diagnostics";
  expect_refused([&] { batch.row_residuals(); }, "diagnostics", remedy);
  expect_refused([&] { batch.row_states(); }, "diagnostics", remedy);
  expect_refused([&] { batch.energy_balances(); }, "diagnostics", remedy);
  expect_refused([&] { batch.conflicts(0); }, "diagnostics", remedy);
  EXPECT_NO_THROW(batch.limit_violations());
  EXPECT_NO_THROW(batch.speeds());
  const Batch<double> recorded(compile(model, recording(GetParam())), 3, serial);
  for (int e : {0, 2}) EXPECT_NO_THROW(recorded.conflicts(e));
  for (int e : {-1, 3}) expect_refused([&] { recorded.conflicts(e); }, "environment " + std::to_string(e), "0 to 2");
}

TEST_P(BoundsReadback, reports_violations_and_speeds_of_the_state) {
  const Model model = contract::bounded(scenes::chain8());
  auto batch = scattered<double>(compile(model, contract::settings(GetParam())), 9);
  for (int step = 0; step < 3; ++step, batch.step())
    for (int e = 0; e < 9; ++e) {
      double worst = 0.0, fastest = 0.0;
      for (int dof = 0; dof < 8; ++dof) {
        const Joint& joint = model.joints[static_cast<std::size_t>(dof)];
        const double q = batch.positions()(dof, e);
        worst = std::max({worst, joint.lower - q, q - joint.upper});
        fastest = std::max(fastest, std::abs(batch.velocities()(dof, e)));
      }
      EXPECT_EQ(batch.limit_violations()(0, e), worst);
      EXPECT_EQ(batch.speeds()(0, e), fastest);
    }
}

TEST_P(BoundsReadback, sums_energies_over_the_substeps_of_one_call) {
  for (const Model& model : contract::bounded_scenes()) {
    const Plan plan = compile(model, recording(GetParam()));
    auto once = scattered<double>(plan, 9), often = scattered<double>(plan, 9);
    EXPECT_TRUE((once.energy_balances() == 0.0).all()) << "before the first step";
    for (int call = 0; call < 2; ++call) {  // the sums of the second call start from zero
      Batch<double>::Array sum = Batch<double>::Array::Zero(4, 9);
      const auto before = (once.kinetic_energies() + once.potential_energies()).eval();
      once.step(5);
      for (int i = 0; i < 5; ++i) {
        often.step();
        sum += often.energy_balances();
      }
      const auto after = (once.kinetic_energies() + once.potential_energies()).eval();
      const double scale = std::max(1.0, before.abs().maxCoeff());
      EXPECT_LE((once.energy_balances() - sum).abs().maxCoeff(), 1e-12 * scale);
      EXPECT_LE((once.energy_balances().row(3) - (after - before)).abs().maxCoeff(), 1e-10 * scale);
      EXPECT_TRUE((once.row_states() == often.row_states()).all()) << "states are those of the last substep";
      EXPECT_TRUE((once.row_residuals() == often.row_residuals()).all());
    }
  }
}

// Only the steps before the failure count. Later calls report zero.
TEST_P(BoundsReadback, reports_the_energy_of_the_good_steps_of_a_failed_environment) {
  StepSettings settings = recording(GetParam());
  settings.velocity_bound = 40.0;
  Model model = contract::bounded(scenes::chain8());
  for (int free : {1, 3}) model.joints[static_cast<std::size_t>(free)].upper = infinity;  // the two are coupled
  const Plan plan = compile(model, settings);
  Batch<double> batch(plan, 9, serial), good(plan, 9, serial);
  int steps = 0;
  for (Batch<double>* each : {&batch, &good}) each->efforts()(3, 4) = 40.0;
  for (; good.faulted() == 0 && steps < 100; ++steps) good.step();
  ASSERT_GT(steps, 2);
  ASSERT_EQ(good.faults()[4], Fault::diverged);
  good.reset(EnvironmentSet::all(), {.keep_inputs = true});
  good.step(steps - 1);
  batch.step(steps + 3);
  ASSERT_EQ(batch.faults()[4], Fault::diverged);
  EXPECT_TRUE((batch.energy_balances().col(4) == good.energy_balances().col(4)).all());

  batch.position_targets()(contract::hard_drive, 5) = std::numeric_limits<double>::quiet_NaN();
  for (int call = 0; call < 2; ++call) {
    batch.step(3);
    EXPECT_EQ(batch.faults()[5], Fault::not_finite);
    for (int e : {4, 5}) EXPECT_TRUE((batch.energy_balances().col(e) == 0.0).all());
    EXPECT_TRUE(batch.limit_violations().isFinite().all());
    EXPECT_TRUE(batch.row_states().isFinite().all());
    EXPECT_NO_THROW(batch.conflicts(5));
  }
}

INSTANTIATE_TEST_SUITE_P(method, BoundsReadback, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
