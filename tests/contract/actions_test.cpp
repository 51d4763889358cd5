// Actions of an agent become targets and efforts. SPDX-License-Identifier: Apache-2.0
#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

// j0 and j1 have servos, j2 a kinematic drive, j3 none; j4 and j5 follow, of which j4 has a servo of its own.
Model driven() {
  Model model = scenes::chain8();
  model.couplings = {Coupling::mimic("j4", "j0", -1.0), Coupling::mimic("j5", "j3", -1.0)};
  for (Joint& joint : model.joints) joint.drive = {};
  for (int j : {0, 1, 4}) model.joints[j].drive = {.kp = 20.0, .kd = 1.0, .position_target = 0.1};
  model.joints[2].drive.kinematic = true;
  for (int j : {0, 1, 2}) {
    model.joints[j].lower = -0.5 - j, model.joints[j].upper = 1.5;
    model.joints[j].velocity_limit = 3.0 + j;
  }
  for (Joint& joint : model.joints) joint.effort_limit = 5.0;
  return model;
}

template <class S>
using Array = typename Batch<S>::Array;

template <class S>
void act(Batch<S>& batch, const Array<S>& actions, const ActionMap& map,
         const EnvironmentSet& which = EnvironmentSet::all()) {
  batch.set_actions({actions.data(), actions.outerStride(), 1}, map, which);
}

TEST(DrivenDofs, are_independent_and_have_a_drive) {
  EXPECT_EQ(compile(driven()).independent_dofs(), (std::vector<int>{0, 1, 2, 3, 6, 7}));
  EXPECT_EQ(compile(driven()).driven_dofs(), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(compile(driven(), {.per_environment = {Parameter::drive_gains}}).driven_dofs(),
            (std::vector<int>{0, 1, 2, 3, 6, 7}));
}

template <class S>
class Actions : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(Actions, Scalars);

TYPED_TEST(Actions, map_to_the_ranges_of_the_model_and_are_clipped) {
  using S = TypeParam;
  Batch<S> batch(compile(driven()), 5, {.threads = 1});
  Array<S> actions(3, 5);
  actions.rowwise() = Eigen::Array<S, 1, 5>(S(-1), S(0), S(1), S(-30), std::numeric_limits<S>::infinity());
  const S at[] = {S(-1), S(0), S(1), S(-1), S(1)};
  const Array<S> still = batch.velocity_targets();
  act(batch, actions, {});
  for (int j = 0; j < 3; ++j)
    for (int e = 0; e < 5; ++e)
      EXPECT_NEAR(batch.position_targets()(j, e), 0.5 - 0.5 * j + (1.0 + 0.5 * j) * static_cast<double>(at[e]), 1e-6);
  for (int j : {3, 4, 5, 6, 7}) EXPECT_TRUE((batch.position_targets().row(j) == S(j == 4 ? 0.1 : 0.0)).all()) << j;
  EXPECT_EQ(batch.position_targets()(0, 2), S(1.5)) << "the end itself";
  EXPECT_TRUE((batch.velocity_targets() == still).all());

  act(batch, actions, {.kind = ActionKind::velocity});
  for (int j = 0; j < 3; ++j)
    for (int e = 0; e < 5; ++e)
      EXPECT_NEAR(batch.velocity_targets()(j, e), (3.0 + j) * static_cast<double>(at[e]), 1e-6);

  Array<S> efforts = Array<S>::Constant(6, 5, S(0.5));
  act(batch, efforts, {.kind = ActionKind::effort});
  for (int j : {0, 1, 2, 3, 6, 7}) EXPECT_TRUE((batch.efforts().row(j) == S(2.5)).all()) << j;
  for (int j : {4, 5}) EXPECT_TRUE((batch.efforts().row(j) == S(0)).all()) << "followers";
}

TYPED_TEST(Actions, change_targets_step_by_step_up_to_the_end_of_the_range) {
  using S = TypeParam;
  Batch<S> batch(compile(driven()), 2, {.threads = 1});
  Array<S> actions(3, 2);
  actions << S(1), S(-0.5), S(1), S(-0.5), S(1), S(-0.5);
  act(batch, actions, {.kind = ActionKind::position_change});
  EXPECT_NEAR(batch.position_targets()(0, 0), 0.1 + 0.05 * 2.0, 1e-6);
  EXPECT_NEAR(batch.position_targets()(2, 1), 0.0 - 0.025 * 4.0, 1e-6);
  for (int i = 0; i < 100; ++i) act(batch, actions, {.kind = ActionKind::position_change});
  EXPECT_EQ(batch.position_targets()(1, 0), S(1.5));
  EXPECT_EQ(batch.position_targets()(1, 1), S(-1.5));
}

TYPED_TEST(Actions, map_to_given_ranges_of_the_chosen_environments_with_any_strides) {
  using S = TypeParam;
  Batch<S> batch(compile(driven()), 3, {.threads = 1});
  const Array<S> before = batch.position_targets();
  const std::vector<S> by_environment = {S(-1), S(9), S(0), S(9), S(1), S(9), S(1), S(9), S(1),
                                         S(9),  S(1), S(9), S(0), S(9), S(0), S(9), S(0), S(9)};
  batch.set_actions({by_environment.data(), 2, 6}, {.low = {0.0, -2.0, 3.0}, .high = {1.0, 2.0, 3.0}}, {0, 2});
  EXPECT_NEAR(batch.position_targets()(0, 0), 0.0, 1e-6);
  EXPECT_NEAR(batch.position_targets()(1, 0), 0.0, 1e-6);
  EXPECT_NEAR(batch.position_targets()(0, 2), 0.5, 1e-6);
  EXPECT_EQ(batch.position_targets()(2, 2), S(3));
  EXPECT_TRUE((batch.position_targets().col(1) == before.col(1)).all());
}

TEST(Actions, are_the_targets_of_all_stage_times) {
  Model model = driven();
  model.joints[2].drive = {.kp = 1.0};
  const Plan plan =
      compile(model, {.integrator = Integrator::leapfrog, .ignore = {true, true, true, true}, .stage_inputs = true});
  Batch<double> batch(plan, 2, {.threads = 1});
  ASSERT_GT(batch.position_targets().rows(), plan.dofs());
  act<double>(batch, Array<double>::Constant(3, 2, 1.0), {});
  for (Eigen::Index row = 0; row < batch.position_targets().rows(); ++row)
    EXPECT_EQ(batch.position_targets()(row, 1), row % 8 < 3 ? 1.5 : row % 8 == 4 ? 0.1 : 0.0) << row;
}

TEST(NanAction, is_a_fault_at_once_that_leaves_the_inputs_and_the_neighbours) {
  const Plan plan = compile(driven());
  Batch<float> batch(plan, 4, {.threads = 1}), sound(plan, 4, {.threads = 1});
  Array<float> actions = Array<float>::Constant(3, 4, 0.25f);
  act(sound, actions, {});
  const Array<float> before = batch.position_targets();
  actions(1, 2) = std::numeric_limits<float>::quiet_NaN();
  act(batch, actions, {});
  EXPECT_EQ(batch.faults()[2], Fault::bad_input);
  EXPECT_STREQ(to_string(batch.faults()[2]), "bad_input");
  EXPECT_EQ(batch.faulted(), 1);
  EXPECT_EQ(batch.fault_report(2).stage, FaultStage::values);
  EXPECT_EQ(batch.fault_report(2).dof, 1);
  const std::string words = batch.explain_fault(2);
  for (const char* part : {"bad_input: an action was NaN", "'j1'", "reset"})
    EXPECT_NE(words.find(part), std::string::npos) << words;
  EXPECT_TRUE((batch.position_targets().col(2) == before.col(2)).all());
  act(batch, actions, {});  // the fault stays, and so do the inputs
  act<float>(batch, Array<float>::Constant(3, 4, 0.25f), {});
  EXPECT_TRUE((batch.position_targets().col(2) == before.col(2)).all());
  batch.step(5), sound.step(5);
  EXPECT_TRUE(contract::same_bits(batch, sound, 2));
  EXPECT_EQ(batch.steps()[2], 0u);
  batch.reset({2}, {.keep_inputs = true});
  act<float>(batch, Array<float>::Constant(3, 4, 0.25f), {});
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_EQ(batch.position_targets()(1, 2), sound.position_targets()(1, 2));
}

// A fault that is there already is the first cause.
TEST(NanAction, does_not_hide_an_earlier_fault) {
  Batch<double> batch(compile(driven()), 2, {.threads = 1});
  batch.velocities()(0, 1) = std::nan("");
  batch.step();
  act<double>(batch, Array<double>::Constant(3, 2, std::nan("")), {});
  EXPECT_EQ(batch.faults()[0], Fault::bad_input);
  EXPECT_EQ(batch.faults()[1], Fault::not_finite);
}

TEST(Actions, without_a_range_are_refused_by_joint_and_change_nothing) {
  Model model = driven();
  model.joints[1].upper = infinity;
  model.joints[1].velocity_limit = infinity;
  model.joints[7].effort_limit = infinity;
  Batch<double> batch(compile(model), 2, {.threads = 1});
  const Array<double> three = Array<double>::Zero(3, 2), six = Array<double>::Zero(6, 2);
  const auto refused = [&](const Array<double>& actions, const ActionMap& map, const char* words) {
    try {
      act(batch, actions, map);
      ADD_FAILURE() << "accepted: " << words;
    } catch (const UsageError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
    }
  };
  refused(three, {}, "actions of joint 'j1': have no range, as the model gives it no position range");
  refused(three, {.kind = ActionKind::position_change}, "joint 'j1'");
  refused(three, {.kind = ActionKind::velocity}, "no velocity limit");
  refused(six, {.kind = ActionKind::effort}, "joint 'j7'");
  refused(three, {.kind = ActionKind(9)}, "none of the enumerators");
  refused(three, {.low = {0.0, 0.0, 0.0}}, "3 lower and 0 upper ends");
  refused(three, {.low = {0.0}, .high = {1.0}}, "give 3 of each, or none");
  refused(three, {.low = {0.0, 2.0, 0.0}, .high = {1.0, 1.0, 1.0}}, "joint 'j1': have the range 2 to 1");
  refused(three, {.low = {0.0, 0.0, 0.0}, .high = {1.0, 1.0, infinity}}, "joint 'j2'");
  const ActionMap good = {.low = {0.0, 0.0, 0.0}, .high = {1.0, 1.0, 1.0}};
  EXPECT_THROW(batch.set_actions({}, good), UsageError);
  EXPECT_THROW(act(batch, three, good, {2}), UsageError);
  EXPECT_TRUE((batch.position_targets().topRows(2) == 0.1).all());
  EXPECT_TRUE((batch.efforts() == 0.0).all());
}

}  // namespace
}  // namespace lockstep
