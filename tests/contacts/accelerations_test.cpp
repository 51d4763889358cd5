// Accelerations of the last step and wrenches through joints: closed forms, the momentum of what joints carry.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "reference/loop_models.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr double g = 9.81;

/// From a link's axes to the world's.
template <class S>
Eigen::Matrix3d turn(const Batch<S>& batch, const std::string& link, int e) {
  const auto pose = batch.link_poses(batch.plan().model().link_index(link));
  return Eigen::Quaterniond(pose(3, e), pose(4, e), pose(5, e), pose(6, e)).toRotationMatrix();
}

StepSettings recorded(Integrator integrator, double dt = 0.002) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = integrator;
  settings.record_accelerations = true;
  return settings;
}

/// Two links that swing about different axes, and a site off the axes on the second one.
Model arm() {
  Model m;
  m.name = "arm";
  m.gravity = {0, 0, -g};
  m.links = {{"base", {}},
             {"upper", Inertia::box(1.2, {0.3, 0.05, 0.04}, {0.15, 0, 0})},
             {"lower", Inertia::box(0.7, {0.2, 0.03, 0.04}, {0.1, 0.02, 0})}};
  m.roots = {{"base"}};
  m.joints = {joint("shoulder", JointKind::revolute, "base", "upper", {0, 0, 0.5}, {0, 1, 0}),
              joint("elbow", JointKind::revolute, "upper", "lower", {0.3, 0, 0}, Vector3d(0.3, 0.2, 1.0).normalized())};
  m.joints[0].damping = 0.05, m.joints[1].armature = 0.01;
  return m;
}

class Accelerations : public testing::TestWithParam<Integrator> {};
INSTANTIATE_TEST_SUITE_P(integrator, Accelerations,
                         testing::Values(Integrator::euler, Integrator::leapfrog, Integrator::extrapolated,
                                         Integrator::runge_kutta),
                         [](const auto& tested) { return std::string(to_string(tested.param)); });

TEST_P(Accelerations, of_joints_are_the_change_of_their_velocities) {
  Batch<double> batch(compile(arm(), recorded(GetParam())), 6, {.threads = 1});
  for (int e = 0; e < 6; ++e) batch.efforts()(0, e) = 2.0 * e, batch.efforts()(1, e) = -0.3 * e;
  EXPECT_EQ(read(batch, Quantity::joint_acceleration).abs().maxCoeff(), 0.0);
  for (int call = 0; call < 20; ++call) {
    batch.step(3);
    const Eigen::ArrayXXd before = batch.velocities();
    batch.step();
    const Eigen::ArrayXXd change = (batch.velocities() - before) / 0.002;
    EXPECT_LT((read(batch, Quantity::joint_acceleration) - change).abs().maxCoeff(), 1e-9);
  }
  batch.reset();
  EXPECT_EQ(read(batch, Quantity::joint_acceleration).abs().maxCoeff(), 0.0);
}

// The torque about the axis is what the drive gives and what damping and armature take: off by O(h).
TEST_P(Accelerations, make_the_torque_of_the_joint) {
  if (GetParam() == Integrator::extrapolated || GetParam() == Integrator::runge_kutta) return;  // record no efforts
  const auto error = [&](double dt) {
    StepSettings settings = recorded(GetParam(), dt);
    settings.record_efforts = true;
    const Model model = arm();
    Batch<double> batch(compile(model, settings), 4, {.threads = 1});
    for (int e = 0; e < 4; ++e) batch.efforts()(0, e) = 3.0 - e, batch.efforts()(1, e) = 0.4 * e;
    batch.step(static_cast<int>(std::lround(0.5 / dt)));
    const Eigen::ArrayXXd wrench = read(batch, Quantity::joint_wrench), effort = read(batch, Quantity::drive_effort),
                          change = read(batch, Quantity::joint_acceleration);
    double most = 0.0;
    for (int e = 0; e < 4; ++e)
      for (int j = 0; j < 2; ++j) {
        const Joint& own = model.joints[static_cast<std::size_t>(j)];
        const double torque = own.axis.dot(wrench.col(e).segment<3>(6 * j + 3).matrix());
        const double expected = effort(j, e) - own.damping * batch.velocities()(j, e) - own.armature * change(j, e);
        most = std::max(most, std::abs(torque - expected));
      }
    return most;
  };
  const double coarse = error(0.002), fine = error(0.0005);
  EXPECT_LT(fine, 0.02);
  EXPECT_NEAR(coarse / fine, 4.0, 0.8);
}

// A wheel at a constant rate: the accelerometer feels the centripetal acceleration and the weight.
TEST_P(Accelerations, of_a_site_on_a_wheel_point_to_its_axis) {
  Model m;
  m.name = "wheel";
  m.gravity = {0, 0, -g};
  m.links = {{"base", {}}, {"wheel", Inertia::box(1.0, {0.2, 0.2, 0.1}, Vector3d::Zero())}};
  m.roots = {{"base"}};
  m.joints = {joint("turn", JointKind::revolute, "base", "wheel", {0, 0, 0}, {0, 0, 1})};
  Pose place = Pose::Identity();
  place.translation() = Vector3d(0.1, 0, 0);
  place.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()).toRotationMatrix();  // its y points upwards
  m.sites = {{"imu", "wheel", place}};
  Batch<double> batch(compile(m, recorded(GetParam())), 5, {.threads = 1});
  for (int e = 0; e < 5; ++e) batch.velocities()(0, e) = 3.0 * e;
  batch.step(50);
  const Eigen::ArrayXXd seen = read(batch, Quantity::site_acceleration);
  for (int e = 0; e < 5; ++e) {
    Eigen::Matrix<double, 6, 1> expected;
    expected << 0, 0, 0, -0.1 * 9.0 * e * e, g, 0;
    EXPECT_LT((seen.col(e).matrix() - expected).norm(), 1e-9) << e;
  }
}

// It turns about an axis of its own for ever and falls, so an accelerometer feels the centripetal acceleration alone,
// off by O(h).
TEST_P(Accelerations, of_a_spinning_body_are_those_of_its_points) {
  Model m;
  m.name = "free";
  m.gravity = {0, 0, -g};
  m.links = {{"body", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
  Root root;
  root.link = "body", root.floating = true, root.velocity << 1.0, -2.0, 3.0, 0.4, 0.5, -0.6;
  m.roots = {root};
  const Vector3d place(0.1, 0.2, 0.05), w(1.0, -2.0, 3.0);
  m.sites = {{"imu", "body", at(place)}};
  const auto error = [&](double dt) {
    Batch<double> batch(compile(m, recorded(GetParam(), dt)), 2, {.threads = 1});
    batch.step(static_cast<int>(std::lround(0.1 / dt)));
    const Eigen::ArrayXXd seen = read(batch, Quantity::site_acceleration);
    return (seen.col(1).tail<3>().matrix() - w.cross(w.cross(place))).norm();
  };
  const double coarse = error(1e-3), fine = error(2.5e-4);
  EXPECT_LT(fine, 0.01);
  EXPECT_NEAR(coarse / fine, 4.0, 0.2);
}

// Pendulums at rest bear what hangs below, also where environments differ in mass and gravity is partly compensated.
TEST(JointWrench, at_rest_is_the_weight_of_what_hangs) {
  Model m = arm();
  m.joints[0].axis = {1, 0, 0}, m.joints[1].axis = {1, 0, 0};
  for (std::size_t l = 1; l < 3; ++l)
    m.links[l].inertia = Inertia::box(m.links[l].inertia.mass, {0.1, 0.1, 0.1}, {0, 0, -0.1});
  m.joints[1].origin = at({0, 0, -0.3});
  m.links[2].gravity = 0.75;
  StepSettings settings = recorded(Integrator::leapfrog);
  settings.per_environment = {Parameter::mass, Parameter::link_wrench};
  Batch<float> batch(compile(m, settings), 9, {.threads = 1});
  for (int e = 0; e < 9; ++e) {
    batch.parameter(Parameter::mass)(2, e) = 0.5f + 0.1f * static_cast<float>(e);
    batch.parameter(Parameter::link_wrench)(6 * 2 + 5, e) = -2.0f * static_cast<float>(e);  // force along z
  }
  batch.step(3);
  const Eigen::ArrayXXd wrench = read(batch, Quantity::joint_wrench);
  for (int e = 0; e < 9; ++e) {
    const double lower = 0.75 * g * (0.5 + 0.1 * e) + 2.0 * e;
    EXPECT_NEAR(wrench(6 + 2, e), lower, 1e-4);
    EXPECT_NEAR(wrench(2, e), lower + 1.2 * g, 1e-4);
    for (const int row : {0, 1, 3, 4, 5, 6, 7, 9, 10, 11}) EXPECT_NEAR(wrench(row, e), 0.0, 1e-4) << row;
  }
}

/// A table on a vertical servo, with a block on it.
Model table() {
  Model m;
  m.name = "table";
  m.gravity = {0, 0, -g};
  m.links = {{"base", {}}, {"table", Inertia::box(2.0, {0.4, 0.4, 0.02}, Vector3d::Zero())}};
  m.roots = {{"base"}};
  m.joints = {joint("lift", JointKind::prismatic, "base", "table", {0, 0, 0.5}, {0, 0, 1})};
  m.joints[0].drive = {.kp = 4000.0, .kd = 300.0};
  m.colliders = {{.name = "top", .link = "table", .shape = Shape::box({0.4, 0.4, 0.02}), .friction = 0.6}};
  add_block(m, "load", 1.0, {0.1, 0.1, 0.1}, {0.05, 0.02, 0.56}, 0.6);
  m.contacts = {{"top", "load"}};
  return m;
}

TEST(JointWrench, has_what_contacts_press) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    StepSettings settings = recorded(integrator);
    settings.per_environment = {Parameter::mass};
    Batch<double> batch(compile(table(), settings), 4, {.threads = 1});
    for (int e = 0; e < 4; ++e) batch.parameter(Parameter::mass)(2, e) = 0.5 + 0.5 * e;
    batch.step(2000);
    const Eigen::ArrayXXd wrench = read(batch, Quantity::joint_wrench), seen = read(batch, Quantity::link_acceleration);
    for (int e = 0; e < 4; ++e) {
      const double load = g * (0.5 + 0.5 * e);
      EXPECT_NEAR(wrench(2, e), 2.0 * g + load, 1e-3) << to_string(integrator);
      EXPECT_NEAR(wrench(3, e), 0.02 * load, 2e-3);  // the load's place turns the table
      EXPECT_NEAR(wrench(4, e), -0.05 * load, 2e-3);
      EXPECT_NEAR(seen(6 * 2 + 5, e), g, 1e-3);  // the block rests
    }
  }
}

// The trunk of a quadruped accelerates by what its legs and gravity do: nothing else touches it.
TEST(JointWrench, of_the_legs_moves_the_trunk) {
  Model model = quadruped();
  const double dt = 2e-4;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Plan plan = compile(model, recorded(integrator, dt));
    Batch<double> batch(plan, 3, {.threads = 1});
    for (int e = 0; e < 3; ++e)
      for (int j = 0; j < batch.position_targets().rows(); ++j)
        batch.position_targets()(j, e) += 0.05 * e * (j % 3 - 1);
    for (int call = 0; call < 10; ++call) {
      batch.step(500);
      const Eigen::ArrayXXd wrench = read(batch, Quantity::joint_wrench),
                            seen = read(batch, Quantity::link_acceleration);
      const int trunk = model.link_index(model.roots[0].link);
      const Inertia& own = model.links[static_cast<std::size_t>(trunk)].inertia;
      for (int e = 0; e < 3; ++e) {
        Vector3d sum = Vector3d::Zero();
        int at_trunk = 0, dof = -1;
        for (const Joint& leg : model.joints) {
          if (!leg.moves()) continue;
          ++dof;
          if (leg.parent != model.roots[0].link) continue;
          ++at_trunk;
          const Vector3d force = turn(batch, leg.child, e) * wrench.col(e).segment<3>(6 * dof).matrix();
          sum -= turn(batch, leg.parent, e).transpose() * force;
        }
        EXPECT_EQ(at_trunk, 4);
        const Vector3d expected = own.mass * seen.col(e).segment<3>(6 * trunk + 3).matrix();
        EXPECT_LT((sum - expected).norm(), 2e-3 * (1.0 + own.mass * g))
            << call << " " << sum.transpose() << " | " << expected.transpose();
      }
    }
  }
}

TEST(JointWrench, of_a_four_bar_carries_its_weight) {
  Model model = loop_models::four_bar({.start = {0.5, 0.0}});
  for (Joint& own : model.joints) own.damping = 2.0;
  StepSettings settings = recorded(Integrator::euler);
  Batch<double> batch(compile(model, settings), 2, {.threads = 1});
  batch.step(20000);
  const Eigen::ArrayXXd wrench = read(batch, Quantity::joint_wrench);
  Vector3d sum = Vector3d::Zero();
  double mass = 0.0;
  for (const Link& link : model.links)
    if (link.name != model.roots[0].link) mass += link.inertia.mass;
  int dof = 0;
  for (const Joint& own : model.joints) {
    if (own.parent == model.roots[0].link)
      sum += turn(batch, own.child, 1) * wrench.col(1).segment<3>(6 * dof).matrix();
    ++dof;
  }
  EXPECT_LT((sum + mass * model.gravity).norm(), 1e-3 * mass * g) << sum.transpose() << " " << mass;
}

TEST(Accelerations, are_refused_where_they_are_not_kept) {
  Batch<double> batch(compile(arm()), 1, {.threads = 1});
  EXPECT_THROW(read(batch, Quantity::joint_wrench), UsageError);
  EXPECT_THROW(read(batch, Quantity::link_acceleration), UsageError);
}

TEST(Accelerations, change_no_bit_of_a_step) {
  StepSettings settings = recorded(Integrator::leapfrog);
  Batch<float> with(compile(table(), settings), 3, {.threads = 1});
  settings.record_accelerations = false;
  Batch<float> without(compile(table(), settings), 3, {.threads = 1});
  for (Batch<float>* batch : {&with, &without}) batch->root_velocities().row(3) = 0.7f, batch->step(100);
  EXPECT_TRUE((with.root_poses() == without.root_poses()).all());
  EXPECT_TRUE((with.velocities() == without.velocities()).all());
}

}  // namespace
}  // namespace lockstep
