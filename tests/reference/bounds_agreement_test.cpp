// Bounds in the kernels agree with the scalar reference, method by method. SPDX-License-Identifier: Apache-2.0
//
// The tests make one step of small random mechanisms with up to eight bounds of every kind, about half of them active.
// In the reference, direct and reduced find the minimum of a convex function and check it; pgs and tgs are the sweeps
// of docs/mathematics.md on dense matrices.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "lockstep/plan.h"
#include "physics.h"
#include "plan/program.h"
#include "random_bounds.h"
#include "reference/bounds.h"
#include "reference/servos.h"
#include "reference/step.h"
#include "seeds.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using physics::distance;
using physics::size;

const int seeds = seeds_of(800, 240);
constexpr double close = 1e-8;

StepSettings settings_of(Method method, int seed) {
  constexpr int iterations[] = {1, 2, 4, 16}, velocity_iterations[] = {1, 0, 3};
  StepSettings settings = physics::settings(method, iterations[seed % 4], velocity_iterations[seed / 4 % 3]);
  settings.record_impulses = seed / 12 % 2 == 0;  // without them, direct may take constraint velocities as known
  return settings;
}

bool sweeps(Method method) { return method == Method::pgs || method == Method::tgs; }

// Whether the velocities determine the impulses of couplings. They do not if bounds and couplings depend on each other.
bool independent(const reference::Mechanism& mechanism, const reference::Stage& stage) {
  std::vector<VectorXd> directions;
  for (int c = 0; c < stage.couplings.count(); ++c)
    if (stage.rows[c].active) directions.push_back(stage.jacobian.row(c).transpose());
  std::vector<bool> bounded(mechanism.velocities(), false);
  for (const reference::BoundedRow& row : reference::bounded_rows(mechanism, stage, mechanism.initial_inputs(),
                                                                  {reference::Phase::position, stage.state.q}))
    if (row.dof >= 0) bounded[mechanism.root_velocities() + row.dof] = true;
  for (int i = 0; i < mechanism.velocities(); ++i)
    if (bounded[i]) directions.push_back(VectorXd::Unit(mechanism.velocities(), i));
  if (directions.empty()) return true;
  MatrixXd all(mechanism.velocities(), directions.size());
  for (std::size_t i = 0; i < directions.size(); ++i) all.col(i) = directions[i];
  return all.fullPivLu().rank() == all.cols();
}

int limited_servos(const reference::Mechanism& mechanism) {
  int count = 0;
  for (int dof = 0; dof < mechanism.dofs(); ++dof) count += reference::limited_servo(mechanism.joint(dof));
  return count;
}

void expect_agreement(const Model& model, const StepSettings& settings, int seed) {
  const reference::Mechanism mechanism(model);
  std::optional<reference::Step> found;
  try {
    found = reference::step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
  } catch (const std::logic_error&) {
    // After few sweeps, the velocities may agree with no choice of servos at their limits.
    ASSERT_TRUE(sweeps(settings.method) && limited_servos(mechanism) > 0);
    return;
  }
  const reference::Step& theirs = *found;
  const Plan plan = compile(model, settings);
  Batch<double> batch(plan, 1, physics::by_turns(plan, seed));
  batch.step();
  EXPECT_EQ(batch.faults()[0], Fault::none);
  const reference::State ours = physics::state_of(batch), &exact = theirs.state;
  const double moving = std::max({1.0, size(mechanism.initial_state().v), size(exact.v)});
  EXPECT_LE(distance(ours.v, exact.v), close * moving) << "v";
  EXPECT_LE(distance(ours.q, exact.q), close * std::max(1.0, size(exact.q))) << "q";
  physics::expect_same_poses(ours, exact, close);

  if (!settings.record_impulses) return;
  const VectorXd impulses = batch.coupling_impulses().matrix().col(0);
  const double momentum = std::max(size(theirs.stage.implicit) * moving, size(theirs.impulses));
  if (sweeps(settings.method) || independent(mechanism, theirs.stage)) {
    EXPECT_LE(distance(impulses, theirs.impulses), close * momentum) << "impulses";
  }
}

class BoundsAgreement : public testing::TestWithParam<Method> {};

TEST_P(BoundsAgreement, holds_for_states_after_one_step) {
  for (int seed = 0; seed < seeds; ++seed) {
    SCOPED_TRACE(seed);
    Model model = physics::random_bounds(seed);
    // A few sweeps do not reach the minimum. With other bounds, more than one choice of servos at their limits may then
    // agree with the velocities. BoundsAgreementByKind compares limited servos without other bounds.
    if (sweeps(GetParam()))
      for (Joint& joint : model.joints) joint.effort_limit = infinity;
    expect_agreement(model, settings_of(GetParam(), seed), seed);
    if (HasFailure()) return;
  }
}

TEST_P(BoundsAgreement, holds_for_states_of_forests_after_one_step) {
  for (int seed = 0; seed < seeds / 4; ++seed) {
    SCOPED_TRACE(seed);
    Model model = physics::random_bounds(seed, 1.0 / 240, scenes::forests());
    for (Joint& joint : model.joints) {
      if (sweeps(GetParam())) joint.effort_limit = infinity;
      // The search for the active set misses the minimum of seed 194, where a kinematic joint beyond its range has dry
      // friction, too. This has nothing to do with trees.
      if (joint.drive.kinematic) joint.friction = 0.0;
    }
    expect_agreement(model, settings_of(GetParam(), seed), seed);
    if (HasFailure()) return;
  }
}

// In deep trees, articulated bodies give the responses to bounds.
TEST_P(BoundsAgreement, holds_for_states_of_deep_trees_after_one_step) {
  scenes::RandomOptions deep;
  deep.min_dofs = 24, deep.max_dofs = 32;
  int articulated = 0;
  for (int seed = 0; seed < seeds / 8; ++seed) {
    SCOPED_TRACE(seed);
    Model model = physics::random_bounds(seed, 1.0 / 240, deep);
    for (Joint& joint : model.joints) joint.effort_limit = infinity;
    const StepSettings settings = settings_of(GetParam(), seed);
    articulated += program_of(compile(model, settings)).f64.articulated.used();
    expect_agreement(model, settings, seed);
    if (HasFailure()) return;
  }
  EXPECT_GT(articulated, GetParam() == Method::reduced ? 0 : seeds / 32);
}

// One kind of bound at a time, to find the cause of a failure above.
class BoundsAgreementByKind : public testing::TestWithParam<std::tuple<Method, int>> {};

TEST_P(BoundsAgreementByKind, holds_for_states_after_one_step) {
  const auto [method, kind] = GetParam();
  for (int seed = 0; seed < seeds / 4; ++seed) {
    SCOPED_TRACE(seed);
    Model model = physics::random_bounds(seed);
    for (Joint& joint : model.joints) {
      if (kind != 0) joint.lower = -infinity, joint.upper = infinity;
      if (kind != 1) joint.velocity_limit = infinity;
      if (kind != 2) joint.effort_limit = infinity;
      if (kind != 3) joint.friction = 0.0;
      if (kind != 4 && joint.drive.kinematic) joint.drive = {};
    }
    if (kind != 5)
      for (Coupling& coupling : model.couplings) coupling.force_limit = infinity;
    expect_agreement(model, settings_of(method, seed), seed);
    if (HasFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(method, BoundsAgreement, testing::ValuesIn(physics::methods), physics::method_name);
std::string method_and_kind(const testing::TestParamInfo<std::tuple<Method, int>>& info) {
  constexpr const char* kinds[] = {"range", "velocity", "effort", "friction", "kinematic", "force"};
  return std::string(to_string(std::get<0>(info.param))).append("_").append(kinds[std::get<1>(info.param)]);
}
INSTANTIATE_TEST_SUITE_P(method, BoundsAgreementByKind,
                         testing::Combine(testing::ValuesIn(physics::methods), testing::Range(0, 6)), method_and_kind);

}  // namespace
}  // namespace lockstep
