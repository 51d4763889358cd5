// Inverse kinematics of an arm with mimic joints. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "lockstep/lockstep.h"

namespace lockstep {
namespace {

constexpr int environments = 40;

Plan arm() {
  Model model = import_urdf_file(LOCKSTEP_MODELS "/arm_gripper.urdf").model;
  Pose tip = Pose::Identity();
  tip.translation() = Eigen::Vector3d(0.0, 0.0, 0.045);
  model.add_site("tip", "left_tip", tip);
  return compile(model, {.per_environment = {Parameter::gear_ratio}});
}

// Gear ratios that differ, and poses that random joints reach.
struct Targets {
  explicit Targets(const Plan& plan) : batch(plan, environments, {.threads = 1}) {
    batch.randomize(Parameter::gear_ratio, {.low = 0.9, .high = 1.1});
    batch.reset_random(EnvironmentSet::all(), {.spread = 0.6});
    const Query query{Quantity::site_pose, {plan.site("tip")}};
    poses.resize(7, environments);
    batch.read(std::span(&query, 1), {poses.data(), environments, 1});
    batch.reset_random(EnvironmentSet::all(), {.spread = 0.5, .stream = 3});
  }
  Batch<double> batch;
  Batch<double>::Array poses;
};

void expect_in_range(const Batch<double>& batch) {
  const Model& model = batch.plan().model();
  for (int dof = 0; dof < batch.plan().dofs(); ++dof) {
    const Joint& joint = model.joints[static_cast<std::size_t>(
        model.joint_index(batch.plan().dof_names()[static_cast<std::size_t>(dof)]))];
    EXPECT_GE(batch.positions().row(dof).minCoeff(), joint.lower - 1e-8) << joint.name;
    EXPECT_LE(batch.positions().row(dof).maxCoeff(), joint.upper + 1e-8) << joint.name;
  }
}

TEST(InverseKinematics, reaches_positions_that_can_be_reached) {
  const Plan plan = arm();
  Targets targets(plan);
  const Batch<double>::Array left = targets.batch.inverse_kinematics(plan.site("tip"), targets.poses.topRows(3));
  int reached = 0;
  for (int e = 0; e < environments; ++e) reached += left(0, e) <= 1e-6;
  EXPECT_GE(reached, environments * 9 / 10);  // others end in a corner of the ranges
  EXPECT_TRUE((left.row(1) == 0.0).all());
  const Batch<double>::Array at = targets.batch.site_positions(plan.site("tip"));
  for (int e = 0; e < environments; ++e)
    EXPECT_NEAR((at.col(e) - targets.poses.col(e).head(3)).matrix().norm(), left(0, e), 1e-9);
  EXPECT_LT(targets.batch.coupling_errors().abs().maxCoeff(), 1e-9);
  expect_in_range(targets.batch);
}

TEST(InverseKinematics, reaches_poses_from_nearby) {
  const Plan plan = arm();
  Targets targets(plan);
  const Batch<double>::Array start = targets.batch.positions();
  const Query query{Quantity::site_pose, {plan.site("tip")}};
  targets.batch.read(std::span(&query, 1), {targets.poses.data(), environments, 1});
  for (const int dof : plan.independent_dofs()) targets.batch.positions().row(dof) *= 0.97;
  targets.batch.project();
  const Batch<double>::Array left = targets.batch.inverse_kinematics(plan.site("tip"), targets.poses);
  EXPECT_LE(left.maxCoeff(), 1e-6);
}

TEST(InverseKinematics, comes_as_near_as_it_can) {
  Model model;
  model.links.push_back({"base", {}});
  const auto add = [&](const char* name, const char* parent, double x, double limit) {
    model.links.push_back({name, Inertia::box(0.5, {0.3, 0.05, 0.05}, {0.15, 0, 0})});
    Joint joint;
    joint.name = name, joint.kind = JointKind::revolute, joint.parent = parent, joint.child = name;
    joint.axis = {0, 0, 1}, joint.origin.translation() = Eigen::Vector3d(x, 0, 0);
    joint.lower = -limit, joint.upper = limit, joint.position = 0.3;
    model.joints.push_back(joint);
  };
  add("upper", "base", 0.0, 3.0), add("lower", "upper", 0.3, 3.0);
  Pose end = Pose::Identity();
  end.translation() = Eigen::Vector3d(0.3, 0, 0);
  model.add_site("end", "lower", end);
  Batch<double> batch(compile(model), 2, {.threads = 1});
  Batch<double>::Array targets(3, 2);
  targets << 1.0, 0.6 * std::cos(2.0), 1.0, 0.6 * std::sin(2.0) * 2.0, 0.0, 0.0;
  const Batch<double>::Array left = batch.inverse_kinematics(0, targets, EnvironmentSet::all(), {.iterations = 1000});
  // Stretched towards the target.
  for (int e = 0; e < 2; ++e) {
    EXPECT_NEAR(left(0, e), targets.col(e).matrix().norm() - 0.6, 1e-6);
    EXPECT_NEAR(batch.positions()(0, e), std::atan2(targets(1, e), targets(0, e)), 1e-3);
  }
  // At the end of a range.
  model.joints[0].upper = 0.5, model.joints[1].upper = 0.0, model.joints[1].lower = 0.0;
  model.joints[1].position = 0.0;
  Batch<double> narrow(compile(model), 2, {.threads = 1});
  narrow.inverse_kinematics(0, targets);
  EXPECT_NEAR(narrow.positions()(0, 0), 0.5, 1e-8);
}

TEST(InverseKinematics, has_the_same_bits_for_any_batch) {
  const Plan plan = arm();
  Targets all(plan);
  const Batch<double>::Array start = all.batch.positions(), ratios = all.batch.parameter(Parameter::gear_ratio);
  all.batch.inverse_kinematics(plan.site("tip"), all.poses);
  Batch<double> one(plan, 1, {.threads = 2});
  for (const int e : {0, 7, environments - 1}) {
    one.positions() = start.col(e), one.parameter(Parameter::gear_ratio) = ratios.col(e);
    one.inverse_kinematics(plan.site("tip"), all.poses.col(e));
    EXPECT_TRUE((one.positions().col(0) == all.batch.positions().col(e)).all());
  }
}

TEST(InverseKinematics, refuses_what_does_not_fit_and_changes_nothing) {
  const Plan plan = arm();
  Targets targets(plan);
  const std::vector<std::byte> before = targets.batch.save();
  Batch<double>::Array bad = targets.poses;
  bad(1, 3) = std::nan("");
  EXPECT_THROW(targets.batch.inverse_kinematics(plan.site("tip"), bad), UsageError);
  EXPECT_THROW(targets.batch.inverse_kinematics(99, targets.poses), UsageError);
  EXPECT_THROW(targets.batch.inverse_kinematics(plan.site("tip"), targets.poses.topRows(4)), UsageError);
  EXPECT_THROW(targets.batch.inverse_kinematics(plan.site("tip"), targets.poses.leftCols(2)), UsageError);
  EXPECT_EQ(targets.batch.save(), before);
}

// Whether the end of a range is a number of single precision makes no difference.
TEST(InverseKinematics, goes_on_along_an_end_of_a_range_in_either_precision) {
  for (const double limit : {0.7, 0.35, 0.6}) {
    Model model;
    model.links = {{"base", {}}};
    const char* const names[] = {"base", "a", "b", "c"};
    for (int i = 1; i < 4; ++i) {
      model.links.push_back({names[i], Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
      Joint& joint = model.joints.emplace_back();
      joint.name = names[i], joint.kind = JointKind::revolute, joint.parent = names[i - 1], joint.child = names[i];
      joint.axis = Eigen::Vector3d::UnitZ();
      joint.origin = Pose(Eigen::Translation3d(i == 1 ? 0.0 : 0.4, 0.0, 0.0));
      joint.lower = -2.0, joint.upper = i == 1 ? limit : 2.0;
    }
    model.add_site("tip", "c", Pose(Eigen::Translation3d(0.4, 0.0, 0.0)));
    const Plan plan = compile(model);
    constexpr int many = 200;
    Batch<double> batch(plan, many, {.threads = 1});
    Batch<float> single(plan, many, {.threads = 1});
    std::mt19937 generator(1);
    std::uniform_real_distribution<double> bend(-2.0, 2.0);
    for (int e = 0; e < many; ++e) batch.positions().col(e) << limit, bend(generator), bend(generator);
    const Batch<double>::Array targets = batch.site_positions(plan.site("tip"));
    for (int e = 0; e < many; ++e) {
      batch.positions().col(e) << limit - 0.05, 0.3, 0.3;
      single.positions().col(e) << static_cast<float>(limit - 0.05), 0.3f, 0.3f;
    }
    const auto left = batch.inverse_kinematics(plan.site("tip"), targets);
    const auto left_single = single.inverse_kinematics(plan.site("tip"), targets.cast<float>());
    EXPECT_LE((left_single.row(0) > 1e-4f).count(), (left.row(0) > 1e-4).count() + 4) << limit;
  }
}

}  // namespace
}  // namespace lockstep
