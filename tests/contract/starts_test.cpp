// Starts: named poses with noise, and copies of environments. SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "contract.h"
#include "lockstep/error.h"

namespace lockstep {
namespace {

using Array = Batch<double>::Array;

// A floating trunk with a hip and a knee, a bolted finger whose tip follows its knuckle, a free cube.
Model scene() {
  Model model;
  const Inertia box = Inertia::box(0.5, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero());
  for (const char* link : {"trunk", "thigh", "shin", "base", "proximal", "distal", "cube"})
    model.links.push_back({link, box});
  const auto add = [&](const char* name, const char* parent, const char* child, double lower, double upper) {
    Joint joint;
    joint.name = name, joint.kind = JointKind::revolute, joint.parent = parent, joint.child = child;
    joint.origin.translation() = Eigen::Vector3d(0.1, 0.0, -0.1);
    joint.lower = lower, joint.upper = upper;
    joint.drive.kp = 10.0, joint.drive.kd = 1.0;
    model.joints.push_back(joint);
  };
  add("hip", "trunk", "thigh", -0.5, 1.5);
  add("knee", "thigh", "shin", -2.0, -0.2);
  add("knuckle", "base", "proximal", 0.0, 1.0);
  add("tip", "proximal", "distal", -3.0, 3.0);
  model.joints[3].drive = {};
  model.couplings = {Coupling::mimic("tip", "knuckle", -0.5, -0.1)};
  model.roots = {{"trunk", true}, {"base", false}, {"cube", true}};
  model.roots[2].pose.translation() = Eigen::Vector3d(0.4, 0.0, 0.0);
  model.joints[1].position = -0.8;

  NamedPose stand{"stand", {{"hip", 0.9}, {"knee", -1.8}}};
  stand.velocities = {{"knee", 0.25}};
  stand.velocity_targets = {{"hip", 0.5}};
  stand.efforts = {{"knuckle", 0.125}};
  stand.root_poses["trunk"] = Pose::Identity();
  stand.root_poses["trunk"].translation() = Eigen::Vector3d(0.0, 0.0, 0.4);
  stand.root_poses["trunk"].linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix();
  stand.root_velocities["trunk"] = Twist::Unit(3);
  NamedPose grasp{"grasp", {{"knuckle", 0.75}}};
  grasp.position_targets = {{"knuckle", 0.8}};
  model.poses = {stand, grasp};
  model.time_step = 0.002;
  return model;
}

const Plan& plan() {
  static const Plan it = compile(scene());
  return it;
}

Eigen::Quaterniond turn_of(const Batch<double>& batch, int root, int e) {
  const auto pose = batch.root_poses().col(e).segment(7 * root, 7);
  return Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]);
}

TEST(Starts, put_joints_roots_and_targets_where_the_pose_has_them_and_the_model_has_the_rest) {
  for (const bool by_number : {false, true}) {
    Batch<double> batch(plan(), 3, {.threads = 1});
    batch.positions().setConstant(7.0);
    batch.root_poses().setConstant(0.5);
    EXPECT_TRUE((by_number ? batch.reset_to({1}, 0) : batch.reset_to({1}, "stand")).empty());
    EXPECT_EQ(batch.positions()(0, 0), 7.0) << "a neighbour";
    EXPECT_EQ(batch.resets()[0], 0u);
    EXPECT_EQ(batch.resets()[1], 1u);
    EXPECT_EQ(batch.positions()(0, 1), 0.9);
    EXPECT_EQ(batch.positions()(1, 1), -1.8);
    EXPECT_EQ(batch.positions()(2, 1), 0.0);
    EXPECT_NEAR(batch.positions()(3, 1), 0.1, 1e-15) << "a follower";
    EXPECT_EQ(batch.velocities()(1, 1), 0.25);
    EXPECT_EQ(batch.position_targets()(0, 1), 0.9) << "drives hold the pose";
    EXPECT_EQ(batch.position_targets()(1, 1), -1.8);
    EXPECT_EQ(batch.position_targets()(2, 1), 0.0);
    EXPECT_EQ(batch.velocity_targets()(0, 1), 0.5);
    EXPECT_EQ(batch.efforts()(2, 1), 0.125);
    EXPECT_EQ(batch.root_poses()(2, 1), 0.4);
    EXPECT_NEAR(batch.root_poses()(3, 1), std::cos(0.15), 1e-15);
    EXPECT_EQ(batch.root_velocities()(3, 1), 1.0);
    EXPECT_EQ(batch.root_poses()(7, 1), 0.4) << "the cube is where the model has it";
    EXPECT_EQ(batch.root_poses()(10, 1), 1.0);
    batch.reset_to({1}, "grasp");
    EXPECT_EQ(batch.position_targets()(2, 1), 0.8) << "the pose's own target";
    EXPECT_EQ(batch.positions()(1, 1), -0.8);
    EXPECT_NEAR(batch.positions()(3, 1), 0.475, 1e-15);
    batch.reset_to({1}, "");
    EXPECT_EQ(batch.positions()(2, 1), 0.0);
    batch.efforts().setConstant(3.0);
    batch.reset_to({1}, "stand", {.keep_inputs = true});
    EXPECT_EQ(batch.efforts()(2, 1), 3.0);
  }
}

// Theory of (M141): uniform between the ends of the interval.
TEST(Starts, draw_joints_uniformly_about_the_pose_and_within_the_range) {
  constexpr int many = 4000;
  Batch<double> batch(plan(), many, {.threads = 1, .seed = 3});
  const auto expect_uniform = [&](int dof, double low, double high) {
    const auto q = batch.positions().row(dof);
    EXPECT_GE(q.minCoeff(), low) << dof;
    EXPECT_LE(q.maxCoeff(), high) << dof;
    EXPECT_NEAR(q.mean(), 0.5 * (low + high), 4.0 * (high - low) / std::sqrt(12.0 * many)) << dof;
    EXPECT_NEAR((q - q.mean()).square().mean(), (high - low) * (high - low) / 12.0,
                0.05 * (high - low) * (high - low) / 12.0)
        << dof;
  };
  batch.reset_to(EnvironmentSet::all(), "stand", {.position = 0.3, .velocity = 2.0});
  expect_uniform(0, 0.6, 1.2);
  expect_uniform(1, -2.0, -1.5);  // the lower limit is nearer than the noise
  expect_uniform(2, 0.0, 0.3);    // the pose is at its limit
  EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-14);
  EXPECT_NEAR(batch.velocities().row(1).mean(), 0.25, 0.1);
  EXPECT_LE((batch.velocities().row(1) - 0.25).abs().maxCoeff(), 2.0);
  EXPECT_TRUE((batch.position_targets().row(0) == 0.9).all()) << "noise leaves targets";
  batch.reset_to(EnvironmentSet::all(), "stand", {.spread = 0.5});
  expect_uniform(0, 0.2, 1.2);
  expect_uniform(1, -1.9, -1.0);
  batch.reset_random(EnvironmentSet::all(), {.spread = 1.0});
  expect_uniform(1, -2.0, -0.2);
  batch.reset_random(EnvironmentSet::all(), {.spread = 0.0});
  EXPECT_TRUE((batch.positions().row(1) == -0.8).all()) << "the model's start, not the middle of the range";
}

TEST(Starts, leave_a_pose_outside_its_range_there_and_take_it_no_farther) {
  Model model = scene();
  model.poses[0].positions["hip"] = 2.0;  // 0.5 rad above its limit
  Batch<double> batch(compile(model), 200, {.threads = 1});
  batch.reset_to(EnvironmentSet::all(), "stand");
  EXPECT_TRUE((batch.positions().row(0) == 2.0).all());
  batch.reset_to(EnvironmentSet::all(), "stand", {.position = 1.0});
  EXPECT_LE(batch.positions().row(0).maxCoeff(), 2.0);
  EXPECT_LT(batch.positions().row(0).minCoeff(), 1.1);
  batch.reset_to(EnvironmentSet::all(), "stand", {.spread = 1.0});
  EXPECT_LE(batch.positions().row(0).maxCoeff(), 1.5) << "the whole range";
}

TEST(Starts, draw_parts_of_balls_to_either_side_and_turn_balls_back_into_their_range) {
  constexpr int many = 4000;
  Model model;
  model.links = {{"base", {}}, {"arm", Inertia::box(0.5, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())}};
  model.joints[static_cast<std::size_t>(model.add_ball("shoulder", "base", "arm"))].upper = 0.3;
  Batch<double> batch(compile(model), many, {.threads = 1, .seed = 3});
  for (const double most : {0.15, 0.5}) {
    batch.reset_to(EnvironmentSet::all(), "", {.position = most});
    for (int k = 0; k < 3; ++k) {
      const auto part = batch.positions().row(k);
      EXPECT_NEAR(part.mean(), 0.0, 4.0 * 0.3 / std::sqrt(3.0 * many)) << most << ' ' << k;
      EXPECT_NEAR((part > 0.0).cast<double>().mean(), 0.5, 2.0 / std::sqrt(many)) << most << ' ' << k;
    }
    EXPECT_LE(batch.positions().matrix().colwise().norm().maxCoeff(), 0.3 * (1.0 + 1e-15));
  }
}

TEST(Starts, draw_roots_in_the_worlds_axes_and_free_bodies_by_themselves) {
  constexpr int many = 4000;
  Batch<double> batch(plan(), many, {.threads = 1, .seed = 8});
  PoseNoise noise;
  noise.roots = {{.link = "", .position = {0.2, 0.0, 0.1}, .yaw = 0.5, .linear_velocity = 0.4},
                 {.link = "cube", .any_rotation = true, .angular_velocity = 3.0}};
  batch.reset_to(EnvironmentSet::all(), "stand", noise);
  const Array poses = batch.root_poses();
  EXPECT_LE(poses.row(0).abs().maxCoeff(), 0.2);
  EXPECT_NEAR(poses.row(0).square().mean(), 0.04 / 3.0, 0.001);
  EXPECT_TRUE((poses.row(1) == 0.0).all());
  EXPECT_LE((poses.row(2) - 0.4).abs().maxCoeff(), 0.1);
  EXPECT_TRUE((poses.row(7) == 0.4).all()) << "the cube's own noise moves it nowhere";
  const Eigen::Quaterniond stand(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  double second = 0.0, widest = 0.0, tilt = 0.0;
  for (int e = 0; e < many; ++e) {
    const Eigen::Quaterniond yaw = turn_of(batch, 0, e) * stand.conjugate();
    tilt = std::max(tilt, yaw.vec().head<2>().norm());
    const double angle = 2.0 * std::atan2(yaw.z(), yaw.w());
    widest = std::max(widest, std::abs(angle));
    // The pose's twist turns with the root; noise has each of the world's axes by itself.
    const Eigen::Vector3d own = batch.root_velocities().col(e).segment(3, 3).matrix() - Eigen::Vector3d::UnitX();
    EXPECT_LE((turn_of(batch, 0, e) * own).cwiseAbs().maxCoeff(), 0.4 + 1e-12);
    // Uniform rotations: the mean of R is 0, that of the squared angle's cosine as Haar's measure has it.
    const Eigen::Matrix3d turn = turn_of(batch, 1, e).toRotationMatrix();
    mean += turn / many;
    second += turn.trace() * turn.trace() / many;
    EXPECT_NEAR(turn_of(batch, 1, e).norm(), 1.0, 1e-14);
  }
  EXPECT_LE(tilt, 1e-14);
  EXPECT_LE(widest, 0.5);
  EXPECT_GT(widest, 0.49);
  EXPECT_LE(mean.cwiseAbs().maxCoeff(), 4.0 / std::sqrt(3.0 * many));
  EXPECT_NEAR(second, 1.0, 0.06);  // the character of the rotations' own representation has norm 1
  EXPECT_TRUE((batch.root_velocities().topRows(3) == 0.0).all());
  EXPECT_LE(batch.root_velocities().middleRows(6, 3).matrix().colwise().norm().maxCoeff(), 3.0 * std::sqrt(3.0));
  EXPECT_GT(batch.root_velocities().middleRows(6, 3).abs().maxCoeff(), 2.0);
}

TEST(Starts, have_the_same_bits_for_any_batch_place_threads_and_list) {
  const PoseNoise noise{.position = 0.1, .velocity = 0.5, .roots = {{.yaw = 3.0, .linear_velocity = 1.0}}, .stream = 4};
  Batch<float> many(plan(), 300, {.threads = 2, .seed = 9}), one(plan(), 1, {.threads = 1, .seed = 9, .first_id = 217});
  many.reset_to(EnvironmentSet::all(), "stand", noise);
  one.reset_to({0}, 0, noise);
  EXPECT_TRUE((many.positions().col(217) == one.positions().col(0)).all());
  EXPECT_TRUE((many.velocities().col(217) == one.velocities().col(0)).all());
  EXPECT_TRUE((many.root_poses().col(217) == one.root_poses().col(0)).all());
  EXPECT_TRUE((many.root_velocities().col(217) == one.root_velocities().col(0)).all());
  EXPECT_FALSE((many.positions().col(216) == one.positions().col(0)).all());
  const Eigen::ArrayXf before = one.positions().col(0);
  one.reset_to({0}, 0, noise);
  EXPECT_FALSE((before == one.positions().col(0)).all()) << "the next episode draws anew";
  one.resets()[0] = 0;
  one.reset_to({0}, 0, noise);
  EXPECT_TRUE((before == one.positions().col(0)).all());
}

TEST(Starts, use_the_limits_and_the_offset_of_the_environment) {
  Model model = scene();
  const Plan varied = compile(model, {.per_environment = {Parameter::position_limits, Parameter::offset}});
  Batch<double> batch(varied, 100, {.threads = 1});
  batch.parameter(Parameter::position_limits)(1, 5) = 0.95;  // the hip's upper limit
  batch.parameter(Parameter::offset)(0, 6) = 0.3;
  batch.reset_to(EnvironmentSet::all(), "stand", {.position = 0.3});
  EXPECT_LE(batch.positions()(0, 5), 0.95);
  EXPECT_GT(batch.positions().row(0).maxCoeff(), 1.1);
  EXPECT_NEAR(batch.positions()(3, 6), 0.5 * batch.positions()(2, 6) - 0.3, 1e-14);
  EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-14);
}

TEST(Starts, refuse_what_is_out_of_range_and_change_nothing) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  Batch<float> batch(plan(), 3, {.threads = 1});
  batch.step();
  const auto refused = [&](const PoseNoise& noise) {
    EXPECT_THROW(batch.reset_to(EnvironmentSet::all(), "stand", noise), UsageError);
  };
  for (const double wrong : {-0.1, nan, infinity, 1e39}) {
    refused({.position = wrong});
    refused({.velocity = wrong});
    refused({.roots = {{.position = {0.0, wrong, 0.0}}}});
    refused({.roots = {{.yaw = wrong}}});
    refused({.roots = {{.angular_velocity = wrong}}});
    refused({.roots = {{.linear_velocity = wrong}}});
  }
  refused({.spread = 1.1});
  refused({.roots = {{.link = "base"}}});
  refused({.roots = {{.link = "cube"}, {.link = "cube"}}});
  refused({.stream = stream_count});
  refused({.project = Couplings(9)});
  EXPECT_THROW(batch.reset_to({0}, "sit"), UsageError);
  EXPECT_THROW(batch.reset_to({0}, 2), UsageError);
  EXPECT_THROW(batch.reset_to({0}, -2), UsageError);
  EXPECT_THROW(batch.reset_to({3}, 0), UsageError);
  EXPECT_EQ(batch.steps()[0], 1u);
  EXPECT_EQ(plan().pose("grasp"), 1);
  EXPECT_THROW(plan().pose(""), UsageError);
}

TEST(Starts, are_part_of_a_plans_identity) {
  const std::uint64_t own = plan().model_hash();
  const auto differs = [&](const auto& change) {
    Model model = scene();
    change(model);
    return compile(model).model_hash() != own;
  };
  EXPECT_FALSE(differs([](Model&) {}));
  EXPECT_TRUE(differs([](Model& m) { m.time_step = 0.004; }));
  EXPECT_TRUE(differs([](Model& m) { m.poses.pop_back(); }));
  EXPECT_TRUE(differs([](Model& m) { m.poses[0].positions["hip"] = 0.91; }));
  EXPECT_TRUE(differs([](Model& m) { m.poses[0].root_poses["trunk"].translation().x() = 0.1; }));
}

TEST(Copy, makes_environments_go_on_as_the_one_with_their_own_ids) {
  Model model = scene();
  model.colliders.push_back({.name = "floor", .shape = Shape::half_space()});
  model.colliders.push_back({.name = "box", .link = "cube", .shape = Shape::box({0.1, 0.1, 0.1})});
  model.contacts.push_back({"floor", "box"});
  model.roots[2].pose.translation().z() = 0.051;
  const Plan with_contacts = compile(model, {.per_environment = {Parameter::mass}});
  Batch<double> batch(with_contacts, 9, {.threads = 1}), alone(with_contacts, 9, {.threads = 1});
  for (Batch<double>* own : {&batch, &alone}) {
    own->parameter(Parameter::mass)(6, 4) = 0.8;
    own->root_velocities()(9, 4) = 0.5;
    own->position_targets()(0, 4) = 1.0;
    own->step(40);
  }
  batch.copy(4, {0, 7, 4});
  EXPECT_EQ(batch.parameter(Parameter::mass)(6, 7), 0.8);
  EXPECT_EQ(batch.ids()[7], 7u);
  batch.step(40), alone.step(40);
  for (const int e : {0, 4, 7}) {
    EXPECT_TRUE((batch.positions().col(e) == alone.positions().col(4)).all()) << e;
    EXPECT_TRUE((batch.root_poses().col(e) == alone.root_poses().col(4)).all()) << e;
    EXPECT_EQ(batch.steps()[e], 80u);
  }
  EXPECT_TRUE((batch.positions().col(1) == alone.positions().col(1)).all()) << "a neighbour";
  EXPECT_FALSE((alone.root_poses().col(0) == alone.root_poses().col(4)).all()) << "else nothing was to be copied";
}

TEST(Copy, takes_faults_along_and_refuses_environments_outside_the_batch) {
  Batch<float> batch(plan(), 4, {.threads = 1});
  batch.positions()(0, 2) = std::numeric_limits<float>::quiet_NaN();
  batch.step();
  ASSERT_EQ(batch.faulted(), 1);
  EXPECT_THROW(batch.copy(4, {0}), UsageError);
  EXPECT_THROW(batch.copy(-1), UsageError);
  EXPECT_THROW(batch.copy(2, {0, 4}), UsageError);
  EXPECT_EQ(batch.faulted(), 1);
  batch.copy(2);
  EXPECT_EQ(batch.faulted(), 4);
  EXPECT_EQ(batch.fault_report(0).dof, batch.fault_report(2).dof);
}

}  // namespace
}  // namespace lockstep
