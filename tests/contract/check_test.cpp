// check() finds what is wrong before a step does; names of rows say what a value is about.
// SPDX-License-Identifier: Apache-2.0
#include <set>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

TEST(Check, finds_nothing_in_a_batch_as_it_is_made_or_scattered) {
  for (std::uint64_t seed = 0; seed < 30; ++seed) {
    const Model model = scenes::random_model(seed);
    StepSettings settings = contract::settings(Method::direct, contract::all_parameters(Method::direct, model));
    Batch<double> batch(compile(model, settings), 3, {.threads = 1});
    const std::vector<Problem> found = batch.check();
    EXPECT_TRUE(found.empty()) << seed << " " << found[0].element << " " << found[0].value << " " << found[0].rule;
  }
}

TEST(Check, names_environment_field_row_value_element_and_rule) {
  Model model = scenes::chain8();
  model.roots = {{model.links[0].name, true}};
  model.links[0].inertia = model.links[1].inertia;
  Batch<double> batch(
      compile(model, {.per_environment = {Parameter::mass, Parameter::drive_gains, Parameter::gravity}}), 5,
      {.threads = 1});
  batch.parameter(Parameter::mass)(4, 1) = -2.0;
  batch.parameter(Parameter::gravity)(2, 1) = std::nan("");
  batch.efforts()(3, 2) = infinity;
  batch.root_poses().col(3).tail(4).setZero();
  batch.position_targets()(5, 4) = 0.3;
  batch.velocity_targets()(5, 4) = 0.2;
  batch.parameter(Parameter::drive_gains)(2 * 6, 4) = 1.0;  // so j6 has a drive in this environment
  batch.position_targets()(6, 4) = 0.3;
  const std::vector<Problem> found = batch.check();
  ASSERT_EQ(found.size(), 6u);
  const auto expect = [&](std::size_t i, int environment, const char* field, int row, const char* element,
                          const char* rule) {
    EXPECT_EQ(found[i].environment, environment);
    EXPECT_EQ(found[i].field, field);
    EXPECT_EQ(found[i].row, row);
    EXPECT_EQ(found[i].element, element);
    EXPECT_NE(found[i].rule.find(rule), std::string::npos) << found[i].rule;
  };
  expect(0, 1, "mass", 4, "mass of link 'l3'", "must be above 0");
  EXPECT_EQ(found[0].value, -2.0);
  expect(1, 1, "gravity", 2, "gravity 'z'", "must be finite");
  expect(2, 2, "efforts", 3, "effort of joint 'j3'", "must be finite");
  EXPECT_EQ(found[2].value, infinity);
  expect(3, 3, "root_poses", 3, "the quaternion of root 'base'", "must not be 0");
  expect(4, 4, "position_targets", 5, "position target of joint 'j5'", "no drive");
  expect(5, 4, "velocity_targets", 5, "velocity target of joint 'j5'", "no drive");
  EXPECT_EQ(batch.check({0, 2}).size(), 1u);
  EXPECT_EQ(batch.faulted(), 0) << "it only looks";
  // A step agrees on all but the targets.
  batch.step();
  for (int e = 0; e < 5; ++e) EXPECT_EQ(batch.faults()[e] != Fault::none, e >= 1 && e <= 3) << e;
  EXPECT_THROW(batch.check({5}), UsageError);
}

TEST(NamesOfRows, are_unique_and_as_many_as_the_rows) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Plan plan = compile(scenes::random_model(seed));
    for (int p = 0; p < parameter_count; ++p) {
      const Parameter field = static_cast<Parameter>(p);
      const std::vector<std::string>& names = plan.parameter_row_names(field);
      EXPECT_EQ(static_cast<int>(names.size()), plan.parameter_rows(field)) << to_string(field);
      EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), names.size()) << to_string(field);
    }
  }
  EXPECT_THROW(compile(scenes::chain8()).parameter_row_names(Parameter(77)), UsageError);
}

TEST(NamesOfRows, say_what_the_value_is_about) {
  Model model = scenes::chain8();
  model.couplings = {{"j1", {{"j2", 0.5}, {"j3", 2.0}}, 0.0, Hard{}},
                     Coupling::mimic("j4", "j5", -1.0, 0.0, Spring{3.0, 4.0}),
                     Coupling::mimic("j6", "j7", -1.0, 0.0, Frequency{5.0, 0.5})};
  const Plan plan = compile(model);
  const auto name = [&](Parameter field, std::size_t row) { return plan.parameter_row_names(field)[row]; };
  EXPECT_EQ(name(Parameter::gear_ratio, 1), "j1: j3");
  EXPECT_EQ(name(Parameter::offset, 2), "j6");
  EXPECT_EQ(name(Parameter::softness, 1), "j1 cfm");
  EXPECT_EQ(name(Parameter::softness, 2), "j4 kp");
  EXPECT_EQ(name(Parameter::softness, 5), "j6 damping ratio");
  EXPECT_EQ(name(Parameter::drive_gains, 7), "j3 kd");
  EXPECT_EQ(name(Parameter::position_limits, 4), "j2 lower");
  EXPECT_EQ(name(Parameter::mass, 1), "l0");
  EXPECT_EQ(name(Parameter::center_of_mass, 5), "l0 z");
  EXPECT_EQ(name(Parameter::inertia, 9), "l0 ixy");
  EXPECT_EQ(name(Parameter::link_wrench, 8), "l0 torque z");
  EXPECT_EQ(name(Parameter::link_wrench, 9), "l0 force x");
  EXPECT_EQ(name(Parameter::gravity, 0), "x");
}

// Nothing that is derived from a value outlives a step, so edits need no announcement.
TEST(Edits, after_a_hundred_steps_and_a_reset_are_as_good_as_edits_before_the_first) {
  for (const Method method : physics::methods)
    for (std::uint64_t seed = 0; seed < 6; ++seed) {
      scenes::RandomOptions options;
      options.redundant = false;
      const Model model = seed == 0   ? scenes::chain8()
                          : seed == 1 ? scenes::gripper13()
                                      : scenes::random_model(seed, options);
      ParameterSet fields = contract::all_parameters(method, model);
      if (seed % 2 == 0) fields.insert(Parameter::friction);
      const Plan plan = compile(model, contract::settings(method, fields));
      Batch<float> at_once(plan, 11, {.threads = 1}), late(plan, 11, {.threads = 1});
      late.step(100);
      late.reset();
      for (Batch<float>* batch : {&at_once, &late}) {
        for (int e = 0; e < 11; ++e) contract::scatter(*batch, e, static_cast<std::uint64_t>(e));
        batch->step(10);
      }
      EXPECT_TRUE(contract::same_bits(at_once, late)) << to_string(method) << " " << model.name << " " << seed;
    }
}

// As Model::validate() refuses them.
TEST(Check, knows_offsets_and_switches_that_are_not_finite) {
  for (const double wrong : {infinity, -infinity, std::nan("")})
    for (const Parameter field : {Parameter::offset, Parameter::coupling_switch}) {
      Batch<double> batch(
          compile(scenes::gripper13(), {.per_environment = {Parameter::offset, Parameter::coupling_switch}}), 2,
          {.threads = 1});
      batch.parameter(field)(0, 1) = wrong;
      const std::vector<Problem> found = batch.check();
      ASSERT_EQ(found.size(), 1u);
      EXPECT_EQ(found[0].field, to_string(field));
      const Eigen::ArrayXd before = batch.positions().col(1);
      batch.step(5);
      EXPECT_EQ(batch.faults()[0], Fault::none);
      EXPECT_EQ(batch.faults()[1], Fault::bad_value);
      EXPECT_TRUE((batch.positions().col(1) == before).all());
    }
}

TEST(Ids, do_not_begin_again) {
  const Plan plan = compile(scenes::chain8());
  EXPECT_EQ(Batch<float>(plan, 2, {.threads = 1, .first_id = 0xfffffffeu}).ids()[1], 0xffffffffu);
  EXPECT_THROW(Batch<float>(plan, 3, {.threads = 1, .first_id = 0xfffffffeu}), SettingsError);
}

TEST(Readings, are_not_written_into_the_batch) {
  Batch<double> batch(compile(scenes::chain8(), {.per_environment = {Parameter::mass}}), 4, {.threads = 1});
  const std::vector<Query> velocities = {{Quantity::velocity}};
  EXPECT_THROW(batch.read(velocities, {batch.positions().data(), batch.positions().outerStride()}), UsageError);
  auto masses = batch.parameter(Parameter::mass);
  EXPECT_THROW(batch.read(velocities, {masses.data(), masses.outerStride()}), UsageError);
  Batch<double>::Array own(batch.plan().dofs(), 4);
  batch.read(velocities, {own.data(), own.outerStride()});
}

}  // namespace
}  // namespace lockstep
