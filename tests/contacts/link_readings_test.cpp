// Readings by link: twists and gravity in its own axes, contact forces summed. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;
using Array = Batch<double>::Array;
constexpr int environments = 5;

Array answer(const Batch<double>& batch, const Query& query) {
  Array numbers(batch.plan().query_rows(query), batch.environments());
  batch.read(std::span(&query, 1), {numbers.data(), numbers.outerStride(), 1});
  return numbers;
}

// A block of 1 kg that stands on two pads, which are links of its body, beside a block of 1 kg.
Model padded() {
  Model model;
  model.name = "padded";
  add_block(model, "block", 1.0, {0.1, 0.1, 0.1}, {0, 0, 0.15}, 0.5);
  for (const double side : {-1.0, 1.0}) {
    const std::string name = side < 0 ? "left" : "right";
    model.links.push_back({name, Inertia::box(0.2, {0.02, 0.1, 0.1}, Vector3d::Zero())});
    Joint mount;
    mount.name = name + " mount", mount.kind = JointKind::fixed, mount.parent = "block", mount.child = name;
    mount.origin = at({0.04 * side, 0, -0.1});
    mount.origin.linear() = Eigen::AngleAxisd(M_PI / 2 * side, Vector3d::UnitX()).toRotationMatrix();
    model.joints.push_back(mount);
    model.colliders.push_back({.name = name, .link = name, .shape = Shape::box({0.02, 0.1, 0.1}), .friction = 0.5});
  }
  add_block(model, "other", 1.0, {0.1, 0.1, 0.1}, {0.5, 0, 0.05}, 0.5);
  add_floor(model, 0.5);
  Pose pose = at({0.01, 0.02, 0.03});
  pose.linear() = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  model.add_site("turned", "left", pose);
  model.contacts = {{"floor", "left"}, {"right", "floor"}, {"floor", "block"}, {"other", "floor"}, {"block", "other"}};
  return model;
}

// Environments that differ in motion and in gravity.
Batch<double> tumbling() {
  StepSettings settings;
  settings.per_environment = {Parameter::gravity};
  Batch<double> batch(compile(padded(), settings), environments, {.threads = 1});
  for (int e = 0; e < environments; ++e) {
    batch.root_poses().col(e).segment(3, 4) << 1, 0.3 * e, -0.2 * e, 0.1;
    batch.root_poses().col(e).segment(3, 4) /= batch.root_poses().col(e).segment(3, 4).matrix().norm();
    for (int k = 0; k < 6; ++k) batch.root_velocities()(k, e) = 0.3 * k - 0.5 * e;
    batch.parameter(Parameter::gravity).col(e) << 0.5 * e, -1, 3 - 2 * e;
  }
  batch.parameter(Parameter::gravity).col(4).setZero();
  return batch;
}

// Twists and gravity by the poses and velocities in the world.
void expect_turned(const Array& poses, const Array& velocities, const Array& twists, const Array& gravities,
                   const Array& gravity) {
  for (Eigen::Index i = 0; i < poses.rows() / 7; ++i)
    for (int e = 0; e < environments; ++e) {
      const auto q = poses.col(e).segment(7 * i + 3, 4);
      const Eigen::Matrix3d world = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
      for (int part = 0; part < 2; ++part) {
        const Vector3d velocity = velocities.col(e).segment(6 * i + 3 * part, 3).matrix(),
                       twist = twists.col(e).segment(6 * i + 3 * part, 3).matrix();
        EXPECT_LE((world * twist - velocity).norm(), 1e-12);
      }
      const Vector3d down = gravities.col(e).segment(3 * i, 3).matrix(), g = gravity.col(e).matrix();
      EXPECT_LE((world * down - g.normalized()).norm(), 1e-12);
      EXPECT_NEAR(down.norm(), e == 4 ? 0.0 : 1.0, 1e-12);
    }
}

TEST(LinkReadings, are_velocities_and_gravity_in_the_axes_of_links_and_sites) {
  Batch<double> batch = tumbling();
  const Array gravity = batch.parameter(Parameter::gravity);
  expect_turned(answer(batch, {Quantity::link_pose}), answer(batch, {Quantity::link_velocity}),
                answer(batch, {Quantity::link_twist}), answer(batch, {Quantity::link_gravity}), gravity);
  expect_turned(answer(batch, {Quantity::site_pose}), answer(batch, {Quantity::site_velocity}),
                answer(batch, {Quantity::site_twist}), answer(batch, {Quantity::site_gravity}), gravity);
  // The root link's twist is the root's velocity, which is in its axes.
  EXPECT_LE((answer(batch, {Quantity::link_twist, {0}}) - batch.root_velocities().topRows(6)).abs().maxCoeff(), 1e-12);
  // They are scaled and picked like others.
  const Array all = answer(batch, {Quantity::link_gravity}), one = answer(batch, {Quantity::link_gravity, {2}, -2.0});
  EXPECT_TRUE((one == -2.0 * all.middleRows(6, 3)).all());
}

TEST(LinkReadings, sum_contact_forces_by_link_even_where_links_are_one_body) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    StepSettings settings;
    settings.integrator = integrator;
    Batch<double> batch(compile(padded(), settings), environments, {.threads = 1});
    const Plan& plan = batch.plan();
    batch.root_poses()(2, environments - 1) += 1.0;  // it falls first
    batch.step(1);
    batch.step(479);
    const Array by_link = answer(batch, {Quantity::link_contact_force}),
                found = answer(batch, {Quantity::link_contacts}), by_pair = answer(batch, {Quantity::contact_force}),
                normal = answer(batch, {Quantity::contact_normal_force});

    // By hand, from the pairs.
    Array sum = Array::Zero(by_link.rows(), environments), count = Array::Zero(found.rows(), environments);
    for (std::size_t p = 0; p < plan.contacts().size(); ++p) {
      const PlanContact& pair = plan.contacts()[p];
      const Eigen::Index row = static_cast<Eigen::Index>(p);
      for (const auto& [collider, sign] : {std::pair(pair.first, -1.0), std::pair(pair.second, 1.0)}) {
        const std::string& link = plan.model().colliders[static_cast<std::size_t>(collider)].link;
        if (link.empty()) continue;
        sum.middleRows(3 * plan.link(link), 3) += sign * by_pair.middleRows(3 * row, 3);
        count.row(plan.link(link)) += (normal.row(row) > 0.0).cast<double>();
      }
    }
    EXPECT_LE((sum - by_link).abs().maxCoeff(), 1e-12);
    EXPECT_TRUE((count == found).all());

    // Weights: each pad bears half of 1.4 kg, the other block its own.
    const auto upwards = [&](const char* link) { return by_link(3 * plan.link(link) + 2, 0); };
    EXPECT_NEAR(upwards("left"), 0.7 * 9.81, 0.01);
    EXPECT_NEAR(upwards("right"), 0.7 * 9.81, 0.01);
    EXPECT_NEAR(upwards("other"), 9.81, 0.01);
    EXPECT_EQ(upwards("block"), 0.0);
    EXPECT_EQ(found(plan.link("left"), 0), 1.0);
    EXPECT_EQ(found(plan.link("block"), 0), 0.0);

    // After a reset there is no last step.
    batch.reset();
    EXPECT_TRUE((answer(batch, {Quantity::link_contact_force}) == 0.0).all());
    EXPECT_TRUE((answer(batch, {Quantity::link_contacts}) == 0.0).all());
  }
}

// A ball over a slope of 0.1 along the world's x, and a box in it.
Model above_a_slope() {
  Model model;
  model.name = "above_a_slope";
  add_free(model, "ball", {1.0, Vector3d::Zero(), 1e-3 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.05), {0, 0, 1.5},
           0.5);
  const Eigen::RowVectorXd along = Eigen::RowVectorXd::LinSpaced(13, -0.3, 0.3);
  model.colliders.push_back({.name = "slope", .shape = Shape::height_field(along.replicate(9, 1), 6.0, 6.0)});
  model.colliders.push_back({.name = "box", .shape = Shape::box({0.5, 0.4, 0.8}), .pose = at({0.8, 0.3, 0.0})});
  model.contacts = {{"slope", "ball"}, {"box", "ball"}};
  return model;
}

// The link leans, and the points turn by its yaw alone. There are more of them than one call of a kernel takes.
TEST(HeightScan, is_how_high_the_link_is_above_the_ground_at_each_point) {
  Batch<double> batch(compile(above_a_slope()), environments, {.threads = 1});
  constexpr int points = 75;
  Query scan{Quantity::height_scan, {batch.plan().link("ball")}};
  for (int i = 0; i < points; ++i) scan.points.push_back({0.02 * i * std::cos(i), 0.02 * i * std::sin(i)});
  scan.points.push_back({100.0, 0.0});  // beyond the slope
  const auto yaw_of = [](int e) { return 0.4 + 1.1 * e; };
  for (int e = 0; e < environments; ++e) {
    const Eigen::Quaterniond turn = Eigen::AngleAxisd(yaw_of(e), Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(0.4, Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(-0.3, Vector3d::UnitX());
    batch.root_poses().col(e) << 0.1 * e, -0.2, 1.5 + 0.1 * e, turn.w(), turn.x(), turn.y(), turn.z();
  }
  const Array found = answer(batch, scan);
  ASSERT_EQ(found.rows(), points + 1);
  int on_box = 0;
  for (int e = 0; e < environments; ++e) {
    const double c = std::cos(yaw_of(e)), s = std::sin(yaw_of(e));
    for (int i = 0; i < points; ++i) {
      const auto [ahead, left] = scan.points[static_cast<std::size_t>(i)];
      const double x = 0.1 * e + c * ahead - s * left, y = -0.2 + s * ahead + c * left;
      const bool is_on_box = std::abs(x - 0.8) < 0.25 && std::abs(y - 0.3) < 0.2;
      EXPECT_NEAR(found(i, e), 1.5 + 0.1 * e - (is_on_box ? 0.4 : 0.1 * x), 1e-12) << i << " " << e;
      on_box += is_on_box;
    }
    EXPECT_EQ(found(points, e), std::numeric_limits<double>::infinity());
  }
  EXPECT_GE(on_box, environments);
}

}  // namespace
}  // namespace lockstep
