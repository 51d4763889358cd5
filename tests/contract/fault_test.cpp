// An environment that fails is flagged and frozen, and no other notices. SPDX-License-Identifier: Apache-2.0
#include <functional>
#include <limits>

#include "bounded_scenes.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using contract::outcome;
using contract::same_bits;
using contract::scattered;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr int environments = 21;  // two full tiles of eight lanes and a part of a third
constexpr int damaged = 11;       // within a tile of any width

// A cause of failure: a write to one environment, and the fault that must follow.
template <class S>
struct Cause {
  std::string name;
  std::function<void(Batch<S>&, int)> write;
  Fault fault;
};

template <class S>
std::vector<Cause<S>> causes(const Plan& plan) {
  const S not_a_number = std::numeric_limits<S>::quiet_NaN(), infinite = std::numeric_limits<S>::infinity();
  const S largest = std::numeric_limits<S>::max();
  std::vector<Cause<S>> all = {
      {"NaN position", [=](Batch<S>& b, int e) { b.positions()(1, e) = not_a_number; }, Fault::not_finite},
      {"infinite position", [=](Batch<S>& b, int e) { b.positions()(0, e) = infinite; }, Fault::not_finite},
      {"NaN velocity", [=](Batch<S>& b, int e) { b.velocities()(2, e) = not_a_number; }, Fault::not_finite},
      {"infinite velocity", [=](Batch<S>& b, int e) { b.velocities()(2, e) = -infinite; }, Fault::not_finite},
      {"overflowing velocity", [=](Batch<S>& b, int e) { b.velocities()(2, e) = largest; }, Fault::not_finite},
      {"NaN effort", [=](Batch<S>& b, int e) { b.efforts()(3, e) = not_a_number; }, Fault::not_finite},
      {"infinite effort", [=](Batch<S>& b, int e) { b.efforts()(3, e) = infinite; }, Fault::not_finite},
      {"far position", [=](Batch<S>& b, int e) { b.positions()(0, e) = S(sizeof(S) == 4 ? 1e7 : 1e16); },
       Fault::diverged},
      {"high speed", [=](Batch<S>& b, int e) { b.efforts()(3, e) = S(1e12); }, Fault::diverged}};
  if (!plan.root_names().empty()) {
    all.push_back({"NaN root", [=](Batch<S>& b, int e) { b.root_poses()(1, e) = not_a_number; }, Fault::not_finite});
    all.push_back({"NaN turn", [=](Batch<S>& b, int e) { b.root_poses()(4, e) = not_a_number; }, Fault::not_finite});
    all.push_back(
        {"NaN twist", [=](Batch<S>& b, int e) { b.root_velocities()(5, e) = not_a_number; }, Fault::not_finite});
    all.push_back({"far root", [=](Batch<S>& b, int e) { b.root_poses()(2, e) = S(-3e5); }, Fault::diverged});
  }
  for (const Joint& joint : plan.model().joints) {
    if (!joint.drive.kinematic) continue;
    const int dof = plan.dof(joint.name);
    all.push_back({"NaN position for " + joint.name,
                   [=](Batch<S>& b, int e) { b.position_targets()(dof, e) = not_a_number; }, Fault::not_finite});
    all.push_back({"NaN speed for " + joint.name,
                   [=](Batch<S>& b, int e) { b.velocity_targets()(dof, e) = not_a_number; }, Fault::not_finite});
  }
  const ParameterSet& declared = plan.settings().per_environment;
  if (declared.contains(Parameter::drive_gains)) {  // only then do all joints read their targets
    all.push_back(
        {"NaN target", [=](Batch<S>& b, int e) { b.position_targets()(0, e) = not_a_number; }, Fault::not_finite});
    all.push_back({"NaN target speed", [=](Batch<S>& b, int e) { b.velocity_targets()(7, e) = not_a_number; },
                   Fault::not_finite});
  }
  for (unsigned p = 0; p < parameter_count; ++p) {
    const Parameter parameter = static_cast<Parameter>(p);
    if (!declared.contains(parameter) || plan.parameter_rows(parameter) == 0) continue;
    const bool by_coupling = parameter == Parameter::offset || parameter == Parameter::coupling_switch;
    std::vector<int> rows = {0, plan.parameter_rows(parameter) - 1};
    if (by_coupling) rows.push_back(contract::limited_coupling);  // a bounded row in the bounded scenes
    for (int row : rows) {
      if (parameter == Parameter::mass && row == 0) continue;  // a fixed root may have any mass
      if (parameter == Parameter::link_wrench && row == 0) row = 6;
      const bool has_range = parameter != Parameter::gravity && parameter != Parameter::link_wrench;
      all.push_back({std::string("NaN ") + to_string(parameter) + " " + std::to_string(row),
                     [=](Batch<S>& b, int e) { b.parameter(parameter)(row, e) = not_a_number; },
                     has_range ? Fault::bad_value : Fault::not_finite});
    }
  }
  if (declared.contains(Parameter::mass)) {
    const int last = plan.parameter_rows(Parameter::mass) - 1;
    all.push_back({"negative mass", [=](Batch<S>& b, int e) { b.parameter(Parameter::mass)(last, e) = S(-3000); },
                   Fault::bad_value});
  }
  return all;
}

template <class S>
void expect_contained(const Plan& plan, Target target) {
  const BatchOptions options = {.threads = 1, .target = target};
  Batch<S> sound = scattered<S>(plan, environments, options);
  sound.step(3);
  ASSERT_EQ(sound.faulted(), 0);
  for (const Cause<S>& cause : causes<S>(plan)) {
    SCOPED_TRACE(cause.name);
    Batch<S> batch = scattered<S>(plan, environments, options);
    if (plan.settings().per_environment.contains(Parameter::coupling_switch))
      batch.parameter(Parameter::coupling_switch)
          .col(damaged)
          .setOnes();  // a step does not read couplings that are off
    cause.write(batch, damaged);
    const std::vector<S> before = outcome(batch, damaged);
    batch.step(3);
    EXPECT_EQ(to_string(batch.faults()[damaged]), std::string(to_string(cause.fault)));
    EXPECT_EQ(batch.faulted(), 1);
    EXPECT_TRUE(same_bits(outcome(batch, damaged), before)) << "a first step that fails must change nothing";
    EXPECT_TRUE(same_bits(batch, sound, damaged));

    // The fault stays if its cause is removed.
    batch.efforts().col(damaged).setZero();
    const std::vector<S> frozen = outcome(batch, damaged);
    batch.step(2);
    EXPECT_EQ(batch.faults()[damaged], cause.fault);
    EXPECT_TRUE(same_bits(outcome(batch, damaged), frozen));
  }
}

class FailedEnvironment : public testing::TestWithParam<Method> {};

TEST_P(FailedEnvironment, is_flagged_and_frozen_and_changes_no_bit_of_its_neighbours) {
  Model springs = scenes::chain8();
  springs.couplings[0].softness = Spring{40.0, 1.0};
  springs.couplings[1].softness = Frequency{20.0, 0.5};
  springs.couplings[3].softness = ErpCfm{0.3, 0.1};
  std::vector<Model> models = {scenes::chain8(), springs, scenes::chain32()};
  for (Model& model : contract::small_bounded_scenes()) models.push_back(std::move(model));
  for (const Model& model : models)
    for (const ParameterSet& declared : {ParameterSet{}, contract::all_parameters(GetParam(), model)}) {
      SCOPED_TRACE(model.name + (declared.empty() ? "" : " with all parameters"));
      StepSettings settings = contract::settings(GetParam(), declared);
      settings.record_impulses = !declared.empty();  // without them, direct takes constraint velocities as known
      const Plan plan = compile(model, settings);
      for (Target target : {Target::baseline, Target::avx2, twins::avx2_scalar, Target::avx512}) {
        if (!supported(target)) continue;
        SCOPED_TRACE(to_string(target));
        expect_contained<float>(plan, target);
        expect_contained<double>(plan, target);
      }
    }
}

// The root is fixed: a floating one has pivots of its own, which could notice a fault that the joints' pivots miss.
TEST_P(FailedEnvironment, is_flagged_on_a_long_arm) {
  Model arm = scenes::chain32();
  arm.roots = {{arm.links[0].name, false}};
  expect_contained<double>(compile(arm, contract::settings(GetParam(), {Parameter::mass})), Target::baseline);
}

INSTANTIATE_TEST_SUITE_P(method, FailedEnvironment, testing::ValuesIn(physics::methods), physics::method_name);

// A constant effort takes an environment beyond the velocity bound in the middle of a call. The environment keeps the
// last state within the bound.
TEST(Fault, freezes_at_the_last_good_substep) {
  StepSettings settings;
  settings.velocity_bound = 10.0;
  const Plan plan = compile(scenes::chain8(), settings);
  Batch<double> at_once(plan, 9, {.threads = 1}), one_by_one(plan, 9, {.threads = 1});
  for (Batch<double>* batch : {&at_once, &one_by_one}) batch->efforts()(0, 4) = 60.0;
  int good = 0;
  std::vector<double> last;
  for (int i = 0; i < 40; ++i) {
    last = outcome(one_by_one, 4);
    one_by_one.step();
    if (one_by_one.faulted() > 0) break;
    ++good;
  }
  ASSERT_GT(good, 2);
  ASSERT_LT(good, 40);
  EXPECT_EQ(one_by_one.faults()[4], Fault::diverged);
  EXPECT_TRUE(same_bits(outcome(one_by_one, 4), last));
  EXPECT_LE(one_by_one.velocities().col(4).abs().maxCoeff(), 10.0);
  at_once.step(good + 5);
  EXPECT_EQ(at_once.faults()[4], Fault::diverged);
  EXPECT_TRUE(same_bits(outcome(at_once, 4), last));
  for (Batch<double>* batch : {&at_once, &one_by_one}) {
    const FaultReport report = batch->fault_report(4);
    EXPECT_EQ(report.fault, Fault::diverged);
    EXPECT_EQ(report.stage, FaultStage::state);
    EXPECT_EQ(report.step, static_cast<std::uint32_t>(good));
    EXPECT_DOUBLE_EQ(report.time, good / 240.0);
    EXPECT_EQ(batch->steps()[4], report.step);
    EXPECT_EQ(batch->fault_report(3).dof, -1);
  }
  EXPECT_EQ(at_once.steps()[3], static_cast<std::uint32_t>(good + 5));
  at_once.reset({4});
  EXPECT_EQ(at_once.fault_report(4).stage, FaultStage::none);
  EXPECT_EQ(at_once.steps()[4], 0u);
  EXPECT_EQ(at_once.resets()[4], 1u);
  EXPECT_EQ(at_once.resets()[3], 0u);
}

// Every stage that finds faults says so, and names a dof where it can; by the tables and by machine code.
TEST(Fault, reports_what_found_it) {
  struct Case {
    const char* name;
    std::function<void(Batch<double>&)> write;
    FaultStage stage;
    int dof;
  };
  const std::vector<Case> cases = {
      {"mass below 0", [](Batch<double>& b) { b.parameter(Parameter::mass).col(1).setConstant(-1.0); },
       FaultStage::values, -1},
      {"armature without end", [](Batch<double>& b) { b.parameter(Parameter::armature)(2, 1) = 1e308; },
       FaultStage::matrix, -1},
      {"far joint", [](Batch<double>& b) { b.positions()(3, 1) = 3e5; }, FaultStage::state, 3},
      {"fast joint", [](Batch<double>& b) { b.velocities()(2, 1) = 3e5; }, FaultStage::state, 2},
      {"whirling joint", [](Batch<double>& b) { b.velocities()(0, 1) = 1e3; }, FaultStage::guard, 0},
  };
  Model model = scenes::chain8();
  model.couplings.clear();
  for (Joint& joint : model.joints) joint.lower = -1e9, joint.upper = 1e9;  // positions have a bound then
  StepSettings settings;
  settings.per_environment = {Parameter::mass, Parameter::armature};
  const Plan plan = compile(model, settings);
  for (const Engine engine : physics::engines())
    for (const Case& wrong : cases) {
      SCOPED_TRACE(std::string(wrong.name) + ", " + to_string(engine));
      Batch<double> batch(plan, 9, {.threads = 1, .engine = engine});
      batch.step(2);
      wrong.write(batch);
      batch.step(3);
      const FaultReport report = batch.fault_report(1);
      EXPECT_NE(report.fault, Fault::none);
      EXPECT_STREQ(to_string(report.stage), to_string(wrong.stage)) << batch.explain_fault(1);
      EXPECT_EQ(report.dof, wrong.dof);
      EXPECT_GE(report.step, 2u);
      EXPECT_LT(report.step, 5u);
      EXPECT_EQ(report.step, batch.steps()[1]);
      EXPECT_EQ(batch.faulted(), 1);
    }
}

// `reduced` must not hide the error by moving the follower to its leader.
TEST(Fault, flags_a_follower_at_an_invalid_position) {
  const Plan plan = compile(scenes::chain8(), {.method = Method::reduced, .integrator = Integrator::euler});
  for (const float place : {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN(), 3e38f}) {
    Batch<float> batch(plan, 9, {.threads = 1});
    batch.positions()(0, 4) = place;
    batch.step();
    EXPECT_NE(batch.faults()[4], Fault::none) << place;
    EXPECT_EQ(batch.faulted(), 1);
  }
}

// The pivot of a slider is its mass, and no other number is affected by it.
TEST(Fault, is_singular_for_an_impossible_pivot_by_tables_and_machine_code) {
  StepSettings settings = physics::settings(Method::direct);
  settings.per_environment.insert(Parameter::mass);
  const Plan plan = compile(physics::sliders({1.0, 2.0}), settings);
  const float infinite = std::numeric_limits<float>::infinity();
  for (const float mass : {infinite, -infinite, 0.0f, -1.0f, 1e-39f, 3e38f})
    for (const Engine engine : physics::engines()) {
      SCOPED_TRACE(testing::Message() << mass << ", " << to_string(engine));
      Batch<float> batch(plan, 9, {.threads = 1, .engine = engine});
      batch.velocities().setOnes();
      batch.parameter(Parameter::mass)(1, 4) = mass;
      batch.step();
      EXPECT_EQ(batch.faults()[4], mass == 3e38f ? Fault::singular : Fault::bad_value);
      EXPECT_EQ(batch.faulted(), 1);
    }
}

// The limit clamps an effort, also an infinite one, but not NaN.
TEST(Fault, is_none_for_an_infinite_effort_with_a_limit) {
  Model model = physics::sliders({1.0, 2.0});
  for (Joint& joint : model.joints) joint.effort_limit = 3.0;
  const Plan plan = compile(model, physics::settings(Method::direct));
  for (const Engine engine : physics::engines()) {
    Batch<float> batch(plan, 3, {.threads = 1, .engine = engine});
    batch.efforts()(0, 0) = std::numeric_limits<float>::infinity();
    batch.efforts()(0, 1) = 3.0f;
    batch.efforts()(0, 2) = std::numeric_limits<float>::quiet_NaN();
    batch.step();
    EXPECT_EQ(batch.velocities()(0, 0), batch.velocities()(0, 1));
    EXPECT_EQ(batch.faults()[2], Fault::not_finite);
    EXPECT_EQ(batch.faulted(), 1);
  }
}

TEST(Fault, is_none_where_parameters_have_no_rows) {
  StepSettings settings = physics::settings(Method::direct);
  settings.per_environment = {Parameter::gear_ratio, Parameter::offset, Parameter::coupling_switch};
  settings.record_impulses = settings.record_diagnostics = true;
  Batch<float> batch(compile(physics::sliders({1.0, 2.0}), settings), 40, {.threads = 1});
  batch.velocities().setOnes();
  batch.step();
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_FLOAT_EQ(batch.positions()(1, 39), 1.0f / 240);
}

TEST(Fault, keeps_its_first_code) {
  Batch<double> batch(compile(scenes::chain8()), 3, {.threads = 1});
  batch.positions()(0, 1) = 1e16;
  batch.step();
  EXPECT_EQ(batch.faults()[1], Fault::diverged);
  batch.positions()(0, 1) = nan;
  batch.step();
  EXPECT_EQ(batch.faults()[1], Fault::diverged);
}

TEST(Fault, is_cleared_by_every_kind_of_reset) {
  constexpr int count = 10;
  const Plan plan = compile(scenes::chain8());
  Batch<double> batch(plan, count, {.threads = 1}), initial(plan, count, {.threads = 1});
  const auto fail_all = [&] {
    batch.positions().setConstant(nan);
    batch.step();
    EXPECT_EQ(batch.faulted(), count);
    for (Fault fault : batch.faults()) EXPECT_EQ(fault, Fault::not_finite);
  };
  const auto expect_only = [&](const std::vector<int>& cleared) {
    for (int e = 0; e < count; ++e) {
      const bool clear = std::find(cleared.begin(), cleared.end(), e) != cleared.end();
      EXPECT_EQ(batch.faults()[e] == Fault::none, clear) << e;
      if (clear) {
        EXPECT_TRUE(same_bits(batch, e, initial, 0)) << e;
      }
    }
    EXPECT_EQ(batch.faulted(), count - static_cast<int>(cleared.size()));
  };
  fail_all();
  batch.reset();
  expect_only({0, 1, 2, 3, 4, 5, 6, 7, 8, 9});

  fail_all();
  const bool mask[count] = {false, true, false, false, false, false, false, false, true, false};
  batch.reset(mask);
  expect_only({1, 8});

  fail_all();
  const std::vector<int> ids = {9, 0, 4};
  batch.reset(ids);
  expect_only(ids);

  fail_all();
  const auto start = initial.positions().leftCols(3).eval(), still = initial.velocities().leftCols(3).eval();
  batch.reset(ids, start, still);
  expect_only(ids);
  batch.step();
  initial.step();
  for (int e : ids) EXPECT_TRUE(same_bits(batch, e, initial, 0)) << "it must step like a new environment";
}

// Joint b follows a, and starts away from its coupling, which is corrected over some steps. So a step puts the tendon
// where it was not. The effort drives a beyond the velocity bound in some steps.
template <class S>
void expect_tendon_is_kept(Integrator integrator, Engine engine, double effort) {
  Model model;
  model.links = {{"base", {}}};
  for (const char* name : {"a", "b"})
    model.links.push_back({name, Inertia::box(0.5, {0.1, 0.05, 0.05}, {0.05, 0.0, 0.0})});
  const auto add = [&](const char* name, const char* parent, JointKind kind) -> Joint& {
    Joint joint;
    joint.name = name, joint.kind = kind;
    if (kind != JointKind::tendon) joint.parent = parent, joint.child = name, joint.axis = {0.0, 1.0, 0.0};
    return model.joints.emplace_back(joint);
  };
  add("a", "base", JointKind::revolute);
  add("b", "a", JointKind::revolute).position = 0.2;
  model.joints.back().origin.translation().x() = 0.1;
  add("t", "", JointKind::tendon).stiffness = 1.0;
  model.couplings = {{"b", {{"a", 1.0}}, 0.0, Hard{}, infinity},
                     {"t", {{"a", -1.0}, {"b", -2.0}}, 0.0, Hard{}, infinity}};
  const Plan plan = compile(model, {.integrator = integrator,
                                    .velocity_iterations = integrator == Integrator::euler ? 0 : 1,
                                    .velocity_bound = 100.0});
  Batch<S> batch(plan, 5, {.threads = 1, .engine = engine}), at_once(plan, 5, {.threads = 1, .engine = engine});
  for (Batch<S>* one : {&batch, &at_once}) {
    one->step();
    one->efforts()(0, 3) = static_cast<S>(effort);
    one->positions()(2, 3) += S(0.5), one->velocities()(2, 3) = S(7);  // what stands there is no state, but is kept
  }
  std::vector<S> before;
  int steps = 0;
  for (; steps < 1000 && batch.faulted() == 0; ++steps) {
    before = outcome(batch, 3);
    batch.step();
  }
  ASSERT_NE(batch.faults()[3], Fault::none);
  ASSERT_EQ(steps == 1, std::isinf(effort)) << steps;
  EXPECT_TRUE(same_bits(outcome(batch, 3), before));
  batch.step(3);
  EXPECT_TRUE(same_bits(outcome(batch, 3), before));
  at_once.step(steps + 3);
  for (int e = 0; e < 5; ++e) EXPECT_TRUE(same_bits(at_once, e, batch, e)) << e;
}

TEST(Fault, leaves_tendons_where_they_were) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const Engine engine : physics::engines())
      for (const double effort : {infinity, 20.0}) {
        SCOPED_TRACE(std::string(to_string(integrator)) + " " + to_string(engine) + " " + std::to_string(effort));
        expect_tendon_is_kept<float>(integrator, engine, effort);
        expect_tendon_is_kept<double>(integrator, engine, effort);
      }
}

// The effort of the model makes its environments fail, and so the padding lanes of the tile. The only environment of
// the batch has zero effort.
TEST(Fault, does_not_count_in_padding_lanes) {
  Model model = scenes::chain8();
  model.joints[2].effort = 1e15;
  Batch<float> batch(compile(model), 1);
  ASSERT_EQ(batch.faults().size(), 1u);
  batch.efforts().setZero();
  batch.step(5);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  Batch<float> failing(compile(model), 1);
  failing.step();
  EXPECT_EQ(failing.faulted(), 1);
}

TEST(Fault, has_a_name_for_each_value) {
  EXPECT_STREQ(to_string(Fault::none), "none");
  EXPECT_STREQ(to_string(Fault::not_finite), "not_finite");
  EXPECT_STREQ(to_string(Fault::diverged), "diverged");
  EXPECT_STREQ(to_string(Fault::singular), "singular");
  EXPECT_STREQ(to_string(Fault::bad_value), "bad_value");
}

}  // namespace
}  // namespace lockstep
