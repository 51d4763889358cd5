// Resets to given states, and followers that are put where their leaders are. SPDX-License-Identifier: Apache-2.0
#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::outcome;
using contract::Random;
using contract::same_bits;
using contract::serial;

constexpr int environments = 11;

template <class S>
constexpr double tolerance = sizeof(S) == 4 ? 1e-5 : 1e-13;

// s1 follows s0, s2 follows s1 with an offset, s3 follows s0 and s4, s5 is free.
Model train() {
  Model model = physics::sliders({1.0, 1.0, 1.0, 1.0, 1.0, 1.0});
  model.couplings = {Coupling::mimic("s2", "s1", 0.5, 0.1),
                     Coupling::mimic("s1", "s0", -3.0),
                     {"s3", {{"s0", 1.0}, {"s4", -2.0}}, -0.3, {}, infinity}};
  return model;
}

template <class S>
void fill(Batch<S>& batch, std::uint64_t seed) {
  Random random(seed);
  for (Eigen::Index e = 0; e < batch.positions().cols(); ++e)
    for (Eigen::Index dof = 0; dof < batch.positions().rows(); ++dof) {
      batch.positions()(dof, e) = static_cast<S>(random.uniform(-1.0, 1.0));
      batch.velocities()(dof, e) = static_cast<S>(random.uniform(-1.0, 1.0));
    }
}

// By hand: s2 = -1.5 s0 - 0.1 for the model's ratios, and so on.
template <class S>
void expect_in_train(const Batch<S>& batch, int e, double ratio = -3.0, double offset = -0.3) {
  const auto q = batch.positions().col(e), v = batch.velocities().col(e);
  EXPECT_NEAR(q[1], -ratio * q[0], tolerance<S>);
  EXPECT_NEAR(q[2], 0.5 * ratio * q[0] - 0.1, tolerance<S>);
  EXPECT_NEAR(q[3], -q[0] + 2.0 * q[4] - offset, tolerance<S>);
  EXPECT_NEAR(v[1], -ratio * v[0], tolerance<S>);
  EXPECT_NEAR(v[2], 0.5 * ratio * v[0], tolerance<S>);
  EXPECT_NEAR(v[3], -v[0] + 2.0 * v[4], tolerance<S>);
}

class Projection : public testing::TestWithParam<Method> {};

template <class S>
void expect_projected(const StepSettings& settings) {
  Batch<S> batch(compile(train(), settings), environments, serial);
  fill(batch, 3);
  const auto q = batch.positions().eval(), v = batch.velocities().eval();
  EXPECT_TRUE(batch.project().empty());
  for (int e = 0; e < environments; ++e) {
    expect_in_train(batch, e);
    for (int dof : {0, 4, 5}) {
      EXPECT_EQ(batch.positions()(dof, e), q(dof, e));
      EXPECT_EQ(batch.velocities()(dof, e), v(dof, e));
    }
  }
  EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), tolerance<S>);
}

TEST_P(Projection, puts_followers_where_their_leaders_put_them) {
  expect_projected<float>(physics::settings(GetParam()));
  expect_projected<double>(physics::settings(GetParam()));
}

TEST_P(Projection, uses_the_ratios_and_offsets_of_each_environment) {
  StepSettings settings = physics::settings(GetParam());
  settings.per_environment = {Parameter::gear_ratio, Parameter::offset};
  Batch<double> batch(compile(train(), settings), environments, serial);
  fill(batch, 4);
  for (int e = 0; e < environments; ++e) {
    batch.parameter(Parameter::gear_ratio)(1, e) = 1.0 + e;
    batch.parameter(Parameter::offset)(2, e) = 0.1 * e;
  }
  EXPECT_TRUE(batch.project().empty());
  for (int e = 0; e < environments; ++e) expect_in_train(batch, e, 1.0 + e, 0.1 * e);
}

TEST_P(Projection, changes_only_the_environments_that_are_named) {
  const Plan plan = compile(train(), physics::settings(GetParam()));
  Batch<float> by_ids(plan, environments, serial), by_mask(plan, environments, serial),
      untouched(plan, environments, serial);
  for (Batch<float>* batch : {&by_ids, &by_mask, &untouched}) fill(*batch, 5);
  const std::vector<int> ids = {7, 2};
  bool mask[environments] = {};
  mask[7] = mask[2] = true;
  by_ids.project(ids);
  by_mask.project(mask);
  EXPECT_TRUE(same_bits(by_ids, by_mask));
  for (int e = 0; e < environments; ++e) EXPECT_EQ(bool(same_bits(by_ids, e, untouched, e)), e != 7 && e != 2);
}

TEST_P(Projection, keeps_the_bits_of_states_that_hold_their_couplings) {
  Batch<float> batch(compile(scenes::gripper13(), physics::settings(GetParam(), 50)), 5, serial);
  for (int e = 0; e < 5; ++e) contract::scatter(batch, e, 40 + static_cast<std::uint64_t>(e));
  batch.project();
  batch.step(3);
  batch.project();
  std::vector<std::vector<float>> before;
  for (int e = 0; e < 5; ++e) before.push_back(outcome(batch, e));
  batch.project();
  for (int e = 0; e < 5; ++e) EXPECT_TRUE(same_bits(outcome(batch, e), before[e]));
}

TEST(Snapshot, continues_a_run_to_the_last_bit) {
  const Plan plan = compile(train());
  Batch<float> run(plan, 3, serial), continued(plan, 3, serial);
  fill(run, 6);
  run.project();
  run.step(7);
  const std::vector<int> ids = {0, 1, 2};
  EXPECT_TRUE(continued.reset(ids, run.positions(), run.velocities()).empty());
  EXPECT_TRUE(same_bits(run, continued));
  run.step(5);
  continued.step(5);
  EXPECT_TRUE(same_bits(run, continued));
}

INSTANTIATE_TEST_SUITE_P(method, Projection, testing::ValuesIn(physics::methods), physics::method_name);

// x + y + u = 0 and y - x + w = 0: both hold x and y, so y = -(u + w) / 2 and x = (w - u) / 2.
TEST(ProjectionOfARing, solves_couplings_that_wait_for_each_other) {
  Model model = physics::sliders({1.0, 1.0, 1.0, 1.0});
  model.couplings = {{"s0", {{"s1", 1.0}, {"s2", 1.0}}, 0.0, {}, infinity},
                     {"s1", {{"s0", -1.0}, {"s3", 1.0}}, 0.0, {}, infinity}};
  Batch<double> batch(compile(model), 1, serial);
  EXPECT_EQ(batch.plan().independent_dofs(), (std::vector{2, 3}));
  batch.positions().col(0) << std::nan(""), 1e9, 0.25, 0.75;
  batch.velocities().col(0) << 5.0, 5.0, 1.0, 3.0;
  EXPECT_TRUE(batch.project().empty());
  EXPECT_NEAR(batch.positions()(0, 0), 0.25, 1e-15);
  EXPECT_NEAR(batch.positions()(1, 0), -0.5, 1e-15);
  EXPECT_NEAR(batch.velocities()(0, 0), 1.0, 1e-15);
  EXPECT_NEAR(batch.velocities()(1, 0), -2.0, 1e-15);
}

// Two couplings have the follower s1: s1 = s0 and s1 = -s2. The second one places s2.
TEST(ProjectionOfARing, gives_two_couplings_of_one_joint_two_followers) {
  Model model = physics::sliders({1.0, 1.0, 1.0});
  model.couplings = {Coupling::mimic("s1", "s0", -1.0), Coupling::mimic("s1", "s2", 1.0)};
  Batch<double> batch(compile(model), 1, serial);
  fill(batch, 8);
  const int free = batch.plan().independent_dofs().at(0);
  const double q = batch.positions()(free, 0);
  EXPECT_TRUE(batch.project().empty());
  EXPECT_EQ(batch.positions()(free, 0), q);
  EXPECT_EQ(batch.positions()(0, 0), batch.positions()(1, 0));
  EXPECT_EQ(batch.positions()(2, 0), -batch.positions()(1, 0));
}

TEST(UnmetCouplings, are_named_with_their_environment_and_error) {
  StepSettings settings;
  settings.per_environment = {Parameter::offset};
  Model model = physics::sliders({1.0, 1.0, 1.0});
  model.couplings = {Coupling::mimic("s1", "s0", -1.0), Coupling::mimic("s2", "s1", -1.0),
                     Coupling::mimic("s2", "s0", -1.0)};
  Batch<float> batch(compile(model, settings), 6, serial);
  ASSERT_EQ(batch.plan().redundant_couplings(), (std::vector{2}));
  EXPECT_TRUE(batch.project().empty());
  batch.parameter(Parameter::offset)(2, 4) = 0.25f;  // s2 = s0 by the first two, s2 = s0 - 0.25 by the third
  batch.positions().row(0).setConstant(0.5f);
  const std::vector<UnmetCoupling> unmet = batch.project();
  ASSERT_EQ(unmet.size(), 1u);
  EXPECT_EQ(unmet[0].environment, 4);
  EXPECT_EQ(unmet[0].coupling, 2);
  EXPECT_EQ(unmet[0].error, 0.25);
  EXPECT_EQ(unmet[0].velocity_error, 0.0);
  EXPECT_EQ(batch.positions()(2, 4), 0.5f);  // the others are met
  batch.parameter(Parameter::offset)(2, 4) = 0.0f;
  batch.positions()(0, 1) = std::numeric_limits<float>::quiet_NaN();
  const std::vector<UnmetCoupling> of_nan = batch.project();
  ASSERT_EQ(of_nan.size(), 3u);
  EXPECT_EQ(of_nan[0].environment, 1);
}

TEST(SoftCouplings, keep_their_stretch_unless_all_are_projected) {
  Model model = train();
  model.couplings[1].softness = Spring{50.0, 1.0};
  for (const Method method : physics::methods) {
    Batch<double> batch(compile(model, physics::settings(method)), 2, serial);
    batch.positions().setConstant(0.4);
    EXPECT_TRUE(batch.project().empty());
    EXPECT_EQ(batch.positions()(1, 0), 0.4);
    EXPECT_NEAR(batch.positions()(2, 0), -0.3, 1e-15);  // it hangs on s1, where that is
    EXPECT_TRUE(batch.project(EnvironmentSet::all(), Couplings::all).empty());
    for (int e : {0, 1}) expect_in_train(batch, e);
    batch.positions().setConstant(0.4);
    EXPECT_TRUE(batch.project(EnvironmentSet::all(), Couplings::none).empty());
    EXPECT_EQ(batch.positions()(2, 1), 0.4);
  }
}

TEST(SoftCouplings, give_way_to_hard_ones_that_contradict_them) {
  Model model = physics::sliders({0.02, 0.03});
  model.couplings = {Coupling::mimic("s1", "s0", -1.0, 0.1), Coupling::mimic("s1", "s0", -1.0)};
  model.couplings[0].softness = Spring{50.0, 1.0};
  for (const Method method : physics::methods) {
    Batch<double> batch(compile(model, physics::settings(method)), 1, serial);
    batch.positions().setConstant(0.4);
    const std::vector<UnmetCoupling> unmet = batch.project(EnvironmentSet::all(), Couplings::all);
    ASSERT_EQ(unmet.size(), 1u);
    EXPECT_EQ(unmet[0].coupling, 0);
    EXPECT_EQ(batch.coupling_errors()(1, 0), 0.0);
  }
}

TEST(SoftCouplings, are_told_apart_by_environment) {
  StepSettings settings;
  settings.per_environment = {Parameter::softness, Parameter::coupling_switch};
  Batch<double> batch(compile(train(), settings), 3, serial);
  batch.positions().setConstant(0.4);
  batch.parameter(Parameter::softness)(3, 1) = 0.01;  // the cfm of s1's coupling
  batch.parameter(Parameter::coupling_switch)(1, 2) = 0.0;
  EXPECT_TRUE(batch.project().empty());
  EXPECT_NEAR(batch.positions()(1, 0), 1.2, 1e-15);
  EXPECT_EQ(batch.positions()(1, 1), 0.4);
  EXPECT_EQ(batch.positions()(1, 2), 0.4);
  EXPECT_TRUE(batch.project(EnvironmentSet::all(), Couplings::all).empty());
  EXPECT_NEAR(batch.positions()(1, 1), 1.2, 1e-15);
  EXPECT_EQ(batch.positions()(1, 2), 0.4);
}

// The follower of a mimic alone: what a user writes who knows leaders only.
TEST(Reset, places_followers_unless_told_otherwise) {
  Model model = physics::sliders({0.02, 0.03});
  model.couplings = {Coupling::mimic("s1", "s0", -1.0)};
  Batch<float> batch(compile(model), 2, serial);
  Batch<float>::Array start = Batch<float>::Array::Zero(2, 1), still = start;
  start(0, 0) = 0.5f;
  const int first[] = {0}, second[] = {1};
  EXPECT_TRUE(batch.reset(first, start, still).empty());
  EXPECT_TRUE(batch.reset(second, start, still, {.project = Couplings::none}).empty());
  EXPECT_EQ(batch.positions()(1, 0), 0.5f);
  EXPECT_EQ(batch.positions()(1, 1), 0.0f);
  batch.step(240);
  EXPECT_EQ(batch.positions()(0, 0), 0.5f);
  EXPECT_EQ(batch.positions()(1, 0), 0.5f);
}

TEST(Reset, takes_views_of_the_batch_itself) {
  const Plan plan = compile(scenes::chain8());
  Batch<double> batch(plan, 6, serial), copied(plan, 6, serial);
  for (Batch<double>* each : {&batch, &copied}) fill(*each, 9);
  const std::vector<int> ids = {1, 2, 0};  // the columns 0, 1, 2 go to these
  const Batch<double>::Array q = copied.positions().leftCols(3), v = copied.velocities().leftCols(3);
  copied.reset(ids, q, v);
  batch.reset(ids, batch.positions().leftCols(3), batch.velocities().leftCols(3));
  EXPECT_TRUE(same_bits(batch, copied));
  const std::vector<int> all = {0, 1, 2, 3, 4, 5};
  for (Batch<double>* each : {&batch, &copied}) each->project();
  batch.reset(all, batch.positions(), batch.velocities());  // changes nothing
  EXPECT_TRUE(same_bits(batch, copied));
}

TEST(Reset, clears_the_faults_of_listed_environments_alone) {
  Batch<double> batch(compile(scenes::chain8()), 5, serial);
  batch.velocities()(0, 2) = batch.velocities()(0, 3) = std::numeric_limits<double>::quiet_NaN();
  batch.step();
  ASSERT_EQ(batch.faulted(), 2);
  // A fault stays where others are reset, and where someone writes to the environment.
  const std::vector<int> healthy = {0, 4};
  batch.reset(healthy);
  batch.positions().col(2).setZero();
  batch.velocities().col(2).setZero();
  batch.project();
  batch.step();
  EXPECT_EQ(batch.faulted(), 2);
  EXPECT_EQ(batch.faults()[2], Fault::not_finite);
  EXPECT_THROW(batch.reset({2, 9}), UsageError);
  EXPECT_EQ(batch.faults()[2], Fault::not_finite) << "a reset that is refused clears nothing";
  batch.reset({2});
  EXPECT_EQ(batch.faulted(), 1);
}

TEST(Project, refuses_what_does_not_fit) {
  Batch<double> batch(compile(train()), 4, serial);
  const bool short_mask[3] = {};
  EXPECT_THROW(batch.project(short_mask), UsageError);
  EXPECT_THROW(batch.project({4}), UsageError);
  EXPECT_THROW(batch.project(EnvironmentSet::all(), static_cast<Couplings>(7)), UsageError);
}

// Two couplings that lock two joints leave velocities of 1e-32, which are 0.
TEST(Project, meets_couplings_of_locked_joints) {
  constexpr int many = 2000;
  Model model = physics::sliders({1.0, 1.0});
  model.couplings = {{"s0", {{"s1", 0.7}}, 0.2, {}, infinity}, {"s0", {{"s1", 1.7}}, 0.3, {}, infinity}};
  Batch<double> batch(compile(model), many, serial);
  Random random(0);
  for (int e = 0; e < many; ++e)
    for (int dof = 0; dof < 2; ++dof)
      batch.positions()(dof, e) = random.uniform(-0.5, 0.5), batch.velocities()(dof, e) = random.uniform(-2.0, 2.0);
  EXPECT_TRUE(batch.project().empty());
  EXPECT_LT(batch.velocities().abs().maxCoeff(), 1e-15);
}

}  // namespace
}  // namespace lockstep
