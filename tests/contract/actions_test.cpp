// Actions of an agent become targets and efforts. SPDX-License-Identifier: Apache-2.0
#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

// j0 and j1 have servos, j2 a kinematic drive, j3 none; j4 and j5 follow.
Model driven() {
  Model model = scenes::chain8();
  model.couplings = {Coupling::mimic("j4", "j0", -1.0), Coupling::mimic("j5", "j3", -1.0)};
  for (Joint& joint : model.joints) joint.drive = {};
  for (int j : {0, 1}) model.joints[j].drive = {.kp = 20.0, .kd = 1.0, .position_target = 0.1};
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

// A gripper: two slides, of which the follower goes twice as far. The only servo is on one of them, as in a Panda's
// hand.
Model gripper(const std::string& servo_on) {
  Model model;
  model.name = "gripper";
  model.gravity.setZero();
  model.links.push_back({"palm", Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
  for (const char* name : {"left", "right"}) {
    model.links.push_back({name, Inertia::box(0.1, {0.02, 0.02, 0.02}, Eigen::Vector3d::Zero())});
    Joint joint;
    joint.name = name, joint.kind = JointKind::prismatic, joint.parent = "palm", joint.child = name;
    joint.axis = Eigen::Vector3d::UnitY(), joint.armature = 0.1;
    joint.lower = 0.0, joint.upper = joint.name == "left" ? 0.03 : 0.08;
    if (joint.name == servo_on) joint.drive = {.kp = 100.0, .kd = 10.0};
    model.joints.push_back(joint);
  }
  model.couplings = {Coupling::mimic("right", "left", -2.0)};
  return model;
}

TEST(DrivenDofs, have_a_drive) {
  EXPECT_EQ(compile(driven()).independent_dofs(), (std::vector<int>{0, 1, 2, 3, 6, 7}));
  EXPECT_EQ(compile(driven()).driven_dofs(), (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(compile(driven(), {.per_environment = {Parameter::drive_gains}}).driven_dofs(),
            (std::vector<int>{0, 1, 2, 3, 6, 7}));
  Model model = driven();
  model.joints[5].drive.kp = 1.0;
  EXPECT_EQ(compile(model).driven_dofs(), (std::vector<int>{0, 1, 2, 5})) << "a follower, beside its leader";
}

// The follower's servo has the gains that a servo of four times as much has on the leader, so both move alike.
TEST(Gripper, is_driven_by_the_servo_on_its_follower) {
  const Plan plan = compile(gripper("right"));
  const int left = plan.dof("left"), right = plan.dof("right");
  ASSERT_EQ(plan.independent_dofs(), std::vector<int>{left});
  ASSERT_EQ(plan.driven_dofs(), std::vector<int>{right});
  Model alike = gripper("left");
  alike.joints[0].drive = {.kp = 400.0, .kd = 40.0};
  Batch<double> batch(plan, 3, {.threads = 1}), leading(compile(alike), 3, {.threads = 1});
  const Array<double> actions = Eigen::RowVector3d(-1.0, 0.5, 1.0);
  act<double>(batch, actions, {}), act<double>(leading, actions, {});
  for (int e = 0; e < 3; ++e) {
    EXPECT_NEAR(batch.position_targets()(right, e), 0.03 * (1.0 + actions(e)), 1e-15) << "what the leader leaves";
    EXPECT_NEAR(leading.position_targets()(left, e), 0.015 * (1.0 + actions(e)), 1e-15);
  }
  for (int i = 0; i < 20; ++i) {
    batch.step(10), leading.step(10);
    EXPECT_TRUE((batch.positions() - leading.positions()).abs().maxCoeff() < 1e-12) << i;
    EXPECT_LE(batch.positions().row(left).maxCoeff(), 0.03 + 1e-12);
  }
  batch.step(2000);
  for (int e = 0; e < 3; ++e) EXPECT_NEAR(batch.positions()(right, e), 0.03 * (1.0 + actions(e)), 1e-9);
}

// Where the leader is at its upper end, such a follower is at its lower one.
TEST(Gripper, has_the_range_of_a_leader_that_moves_the_other_way) {
  Model model = gripper("right");
  model.couplings = {Coupling::mimic("right", "left", 2.0)};
  model.joints[1].lower = -0.08;
  Batch<double> batch(compile(model), 3, {.threads = 1});
  act<double>(batch, Eigen::RowVector3d(-1.0, 0.0, 1.0), {});
  for (int e = 0; e < 3; ++e)
    EXPECT_NEAR(batch.position_targets()(batch.plan().dof("right"), e), 0.03 * (e - 2), 1e-15);
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
  for (int j : {3, 4, 5, 6, 7}) EXPECT_TRUE((batch.position_targets().row(j) == S(0)).all()) << j;
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

TYPED_TEST(Actions, scale_about_a_center_or_the_pose_of_the_model) {
  using S = TypeParam;
  Model model = driven();
  model.joints[0].position = 0.3, model.joints[4].position = 0.3;
  Batch<S> batch(compile(model), 2, {.threads = 1});
  Array<S> actions(3, 2);
  actions << S(1), S(-0.5), S(1), S(-0.5), S(7), S(-0.5);
  act(batch, actions, {.scale = {0.5, 0.25, -0.1}});
  EXPECT_NEAR(batch.position_targets()(0, 0), 0.8, 1e-6);
  EXPECT_NEAR(batch.position_targets()(0, 1), 0.05, 1e-6);
  EXPECT_NEAR(batch.position_targets()(1, 1), model.joints[1].position - 0.125, 1e-6);
  EXPECT_NEAR(batch.position_targets()(2, 0), model.joints[2].position - 0.1, 1e-6) << "clipped";
  act(batch, actions, {.scale = {0.5, 0.5, 0.5}, .center = {1.0, 2.0, 3.0}});
  EXPECT_NEAR(batch.position_targets()(1, 1), 1.75, 1e-6);
  act(batch, actions, {.kind = ActionKind::velocity, .scale = {2.0, 2.0, 2.0}});
  EXPECT_NEAR(batch.velocity_targets()(0, 1), -1.0, 1e-6);
}

// After n calls, 1 - (1 - alpha)^n of the way is done.
TYPED_TEST(Actions, are_averaged_with_the_targets_before) {
  using S = TypeParam;
  Batch<S> batch(compile(driven()), 2, {.threads = 1});
  const Array<S> actions = Array<S>::Constant(3, 2, S(1));
  for (int i = 0; i < 5; ++i) act(batch, actions, {.alpha = 0.3});
  EXPECT_NEAR(batch.position_targets()(0, 1), 1.5 - (1.5 - 0.1) * std::pow(0.7, 5), 1e-6);
  const Array<S> efforts = Array<S>::Constant(6, 2, S(1));
  for (int i = 0; i < 2; ++i) act(batch, efforts, {.kind = ActionKind::effort, .alpha = 0.5});
  EXPECT_NEAR(batch.efforts()(3, 0), 0.75 * 5.0, 1e-6);
}

TYPED_TEST(Actions, are_for_the_chosen_joints_in_their_order) {
  using S = TypeParam;
  Batch<S> batch(compile(driven()), 2, {.threads = 1});
  const Array<S> before = batch.position_targets();
  Array<S> actions(2, 2);
  actions << S(1), S(-1), S(0), S(-1);
  act(batch, actions, {.dofs = {2, 0}});
  EXPECT_EQ(batch.position_targets()(2, 0), S(1.5));
  EXPECT_EQ(batch.position_targets()(2, 1), S(-2.5));
  EXPECT_EQ(batch.position_targets()(0, 1), S(-0.5));
  EXPECT_TRUE((batch.position_targets().row(1) == before.row(1)).all());
  act(batch, actions, {.kind = ActionKind::effort, .dofs = {4, 7}});
  EXPECT_EQ(batch.efforts()(4, 0), S(5)) << "a follower's effort, when it is asked for";
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
    EXPECT_EQ(batch.position_targets()(row, 1), row % 8 < 3 ? 1.5 : 0.0) << row;
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

// Half a radian about the start, up to the end that there is.
TEST(Actions, without_a_range_reach_half_a_radian_about_the_start) {
  Model model = driven();
  model.joints[0].lower = -infinity, model.joints[0].upper = infinity;
  model.joints[1].upper = infinity;
  Batch<double> batch(compile(model), 2, {.threads = 1});
  Array<double> actions(3, 2);
  actions.col(0) = -1.0, actions.col(1) = 1.0;
  act<double>(batch, actions, {});
  for (const int side : {0, 1})
    EXPECT_NEAR(batch.position_targets()(0, side), model.joints[0].position + (side ? 0.5 : -0.5), 1e-15);
  EXPECT_NEAR(batch.position_targets()(1, 0), model.joints[1].lower, 1e-15);
  EXPECT_NEAR(batch.position_targets()(1, 1), model.joints[1].position + 0.5, 1e-15);
  const double before = batch.position_targets()(0, 1);
  act<double>(batch, actions, {.kind = ActionKind::position_change});
  EXPECT_NEAR(batch.position_targets()(0, 1), before + 0.05, 1e-15) << "5 % of a radian, and no end";
}

TEST(Actions, that_do_not_fit_are_refused_and_change_nothing) {
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
  refused(three, {.kind = ActionKind::velocity}, "no velocity limit");
  refused(six, {.kind = ActionKind::effort}, "joint 'j7'");
  refused(three, {.kind = ActionKind(9)}, "none of the enumerators");
  refused(three, {.low = {0.0, 0.0, 0.0}}, "3 lower and 0 upper ends");
  refused(three, {.low = {0.0}, .high = {1.0}}, "give 3 of each, or none");
  refused(three, {.low = {0.0, 2.0, 0.0}, .high = {1.0, 1.0, 1.0}}, "joint 'j1': have the range 2 to 1");
  refused(three, {.low = {0.0, 0.0, 0.0}, .high = {1.0, 1.0, infinity}}, "joint 'j2'");
  refused(three, {.scale = {1.0}}, "scale of actions: has 1 numbers; give 3, or none");
  refused(three, {.center = {1.0, 1.0, 1.0}}, "center of actions: has no scale");
  refused(three, {.low = {0.0, 0.0, 0.0}, .high = {1.0, 1.0, 1.0}, .scale = {1.0, 1.0, 1.0}}, "is given twice");
  refused(three, {.scale = {1.0, infinity, 1.0}}, "joint 'j1'");
  for (const double alpha : {0.0, -1.0, 1.5, std::nan("")}) refused(three, {.alpha = alpha}, "alpha of actions");
  refused(three, {.kind = ActionKind::position_change, .alpha = 0.5}, "changes of position");
  refused(three, {.dofs = {0, 1, 3}}, "actions of joint 'j3': have no drive");
  refused(three, {.dofs = {0, 1, 8}}, "dof 8");
  refused(three, {.dofs = {0, 1, 0}}, "actions of joint 'j0': are two");
  const ActionMap good = {.low = {0.0, 0.0, 0.0}, .high = {1.0, 1.0, 1.0}};
  EXPECT_THROW(batch.set_actions({}, good), UsageError);
  EXPECT_THROW(act(batch, three, good, {2}), UsageError);
  EXPECT_TRUE((batch.position_targets().topRows(2) == 0.1).all());
  EXPECT_TRUE((batch.efforts() == 0.0).all());
}

// A servo by hand is the servo, to rounding where the steps are short; and the steps are those of step().
TEST(StepWithAFunction, calls_it_before_each_step) {
  Batch<double> batch(compile(driven()), 3, {.threads = 1}), plain(compile(driven()), 3, {.threads = 1});
  batch.velocities()(0, 1) = plain.velocities()(0, 1) = 0.5;
  std::vector<int> called;
  EXPECT_TRUE(batch.step(4, [&](int i) {
    called.push_back(i);
    batch.efforts().row(3) = 0.1 * i - batch.velocities().row(3);
  }));
  EXPECT_EQ(called, (std::vector<int>{0, 1, 2, 3}));
  for (int i = 0; i < 4; ++i) {
    plain.efforts().row(3) = 0.1 * i - plain.velocities().row(3);
    plain.step();
  }
  for (int e = 0; e < 3; ++e) EXPECT_TRUE(contract::same_bits(batch, plain, e)) << e;
  EXPECT_EQ(batch.steps()[0], 4u);
}

TEST(StepWithAFunction, passes_on_what_it_throws_and_keeps_the_steps_before) {
  Batch<double> batch(compile(driven()), 2, {.threads = 1});
  const auto fails = [](int i) {
    if (i == 2) throw std::runtime_error("mine");
  };
  EXPECT_THROW(batch.step(4, fails), std::runtime_error);
  EXPECT_EQ(batch.steps()[1], 2u);
  EXPECT_TRUE(batch.step(1)) << "nobody holds it";
  EXPECT_THROW(batch.step(1, nullptr), UsageError);
}

}  // namespace
}  // namespace lockstep
