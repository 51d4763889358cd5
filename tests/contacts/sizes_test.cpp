// Sizes and restitutions of contacts that differ between environments, against a plan for each.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "model/hull.h"
#include "physics.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr double rate = 240.0;

Eigen::Matrix3Xd stone(const Vector3d& scale) {
  Eigen::Matrix3Xd points(3, 7);
  points << 0.05, -0.05, 0.0, 0.0, 0.02, -0.02, 0.0,  //
      0.01, 0.0, 0.05, -0.04, 0.01, -0.02, 0.01,      //
      -0.03, -0.03, -0.03, -0.03, 0.04, 0.03, -0.04;
  return scale.asDiagonal() * points;
}

// The shape of a kind whose sizes are `grows` times the usual ones.
Shape shape_of(ShapeKind kind, const Vector3d& grows) {
  switch (kind) {
    case ShapeKind::box: return Shape::box(Vector3d(0.1, 0.08, 0.06).cwiseProduct(grows));
    case ShapeKind::cylinder: return Shape::cylinder(0.04 * grows[0], 0.07 * grows[1]);
    case ShapeKind::capsule: return Shape::capsule(0.03 * grows[0], 0.06 * grows[1]);
    case ShapeKind::ellipsoid: return Shape::ellipsoid(Vector3d(0.05, 0.04, 0.03).cwiseProduct(grows));
    case ShapeKind::hull: return Shape::hull(stone(grows), 0.0);
    default: return Shape::sphere(0.04 * grows[0]);
  }
}

// Two bodies of these kinds fall on each other and on the ground.
Model pile(ShapeKind lower, ShapeKind upper, const Vector3d& grows, bool on_field) {
  Model model;
  const Inertia inertia{1.0, Vector3d::Zero(), Vector3d(1e-3, 1.2e-3, 1.4e-3).asDiagonal()};
  add_free(model, "lower", inertia, shape_of(lower, grows), {0, 0, 0.12}, 0.5);
  add_free(model, "upper", inertia, shape_of(upper, grows), {0.012, 0.007, 0.3}, 0.5);
  model.roots[0].velocity << 0.1, 0.3, -0.2, 0.05, 0.0, 0.0;
  if (on_field)
    model.colliders.push_back({.name = "floor", .shape = Shape::height_field(Eigen::MatrixXd::Zero(9, 9), 2.0, 2.0)});
  else
    add_floor(model, 0.5);
  model.contacts = {{"floor", "lower"}, {"lower", "upper"}, {"floor", "upper"}};
  return model;
}

StepSettings settings_of(ParameterSet declared) {
  StepSettings settings;
  settings.dt = 1.0 / rate;
  settings.per_environment = declared;
  return settings;
}

struct Sizes : testing::TestWithParam<ShapeKind> {};

TEST_P(Sizes, of_environments_are_those_of_a_plan_each) {
  const std::vector<Vector3d> grows = {{1, 1, 1}, {1.5, 0.7, 1.2}, {0.6, 1.1, 1.4}};
  for (const ShapeKind upper : {GetParam(), ShapeKind::box, ShapeKind::sphere, ShapeKind::hull}) {
    for (const bool on_field : {false, true}) {
      const Model model = pile(GetParam(), upper, grows[0], on_field);
      Batch<double> together(compile(model, settings_of({Parameter::collider_size})), 3, {.threads = 1});
      auto size = together.parameter(Parameter::collider_size);
      for (int e = 0; e < 3; ++e)
        for (int c = 0; c < 2; ++c) {
          const ShapeKind kind = model.colliders[static_cast<std::size_t>(c)].shape.kind;
          const Vector3d numbers = kind == ShapeKind::hull ? grows[e] : shape_of(kind, grows[e]).size;
          size.col(e).segment(3 * c, 3) = numbers.array();
        }
      for (int e = 0; e < 3; ++e) {
        Model own = pile(GetParam(), upper, grows[e], on_field);
        // A hull grows about the centre of its volume, the points about the collider's origin.
        for (std::size_t c = 0; c < 2; ++c) {
          if (own.colliders[c].shape.kind != ShapeKind::hull) continue;
          const Vector3d middle = solid_of(hull_of(stone({1, 1, 1}))).center;
          own.colliders[c].pose = at(middle - grows[e].cwiseProduct(middle));
        }
        Batch<double> alone(compile(own, settings_of({})), 1, {.threads = 1});
        Batch<double> begun(together.plan(), 1, {.threads = 1});
        begun.parameter(Parameter::collider_size).col(0) = size.col(e);
        for (int i = 0; i < 50; ++i) alone.step(1), begun.step(1);
        // Searches end by tolerances of the model's size.
        const bool searches = GetParam() == ShapeKind::hull || upper == ShapeKind::hull;
        EXPECT_LT((alone.root_poses() - begun.root_poses()).matrix().norm(), searches ? 2e-3 : 1e-5)
            << to_string(GetParam()) << " below " << to_string(upper) << ", environment " << e << ", field "
            << on_field;
        EXPECT_LT(alone.root_poses()(9, 0), 0.25) << "the upper one has not moved";
      }
      together.step(50);
      for (const Fault fault : together.faults()) EXPECT_EQ(fault, Fault::none);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, Sizes,
                         testing::Values(ShapeKind::box, ShapeKind::hull, ShapeKind::cylinder, ShapeKind::capsule,
                                         ShapeKind::ellipsoid, ShapeKind::sphere),
                         [](const auto& info) { return std::string(to_string(info.param)); });

// A size that no Model could have freezes its environment alone.
TEST(SizesOf, colliders_out_of_range_are_a_fault) {
  const Model model = pile(ShapeKind::box, ShapeKind::sphere, {1, 1, 1}, false);
  Batch<float> batch(compile(model, settings_of({Parameter::collider_size})), 3, {.threads = 1});
  batch.parameter(Parameter::collider_size)(0, 1) = 2.0f;  // 20 times the edge
  batch.step(1);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  EXPECT_NE(batch.explain_fault(1).find("size of collider 'lower'"), std::string::npos) << batch.explain_fault(1);
}

// Without pairs there are no colliders in a plan, and nothing to differ.
TEST(SizesOf, colliders_that_touch_nothing_have_no_rows) {
  Model model = pile(ShapeKind::box, ShapeKind::sphere, {1, 1, 1}, false);
  model.contacts.clear();
  for (const Parameter field : {Parameter::collider_size, Parameter::collider_place, Parameter::contact_restitution}) {
    const Plan plan = compile(model, settings_of({field}));
    EXPECT_EQ(plan.parameter_rows(field), 0);
    EXPECT_TRUE(plan.parameter_row_names(field).empty());
    Batch<float> batch(plan, 2, {.threads = 1});
    batch.step(3);
    EXPECT_EQ(batch.faulted(), 0);
  }
}

TEST(Restitutions, of_environments_are_those_of_a_plan_each) {
  for (const double models : {0.0, 0.3})
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
      const auto model_of = [](double restitution) {
        Model model;
        add_free(model, "ball", {1.0, Vector3d::Zero(), 6e-4 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.04),
                 {0, 0, 0.3}, 0.5);
        add_floor(model, 0.5);
        model.contacts = {{"floor", "ball"}};
        model.contacts[0].restitution = restitution;
        return model;
      };
      StepSettings settings = settings_of({Parameter::contact_restitution});
      settings.integrator = integrator;
      const std::vector<double> shares = {0.0, 0.5, 0.9};
      Batch<double> together(compile(model_of(models), settings), 3, {.threads = 1});
      for (int e = 0; e < 3; ++e) together.parameter(Parameter::contact_restitution)(0, e) = shares[e];
      settings.per_environment = {};
      std::vector<Batch<double>> alone;
      for (const double share : shares)
        alone.emplace_back(compile(model_of(share), settings), 1, BatchOptions{.threads = 1});
      for (int i = 0; i < 240; ++i) {
        together.step(1);
        for (int e = 0; e < 3; ++e) {
          alone[e].step(1);
          ASSERT_NEAR(together.root_poses()(2, e), alone[e].root_poses()(2, 0), 1e-9) << shares[e] << ", step " << i;
        }
      }
    }
}

// A wall is as near to a body that has grown as to one of that size.
TEST(SizesOf, bodies_over_a_height_field_reach_as_far_as_they_grow) {
  Eigen::MatrixXd heights = Eigen::MatrixXd::Zero(81, 81);
  heights.middleCols(60, 4).setOnes();  // at x = 1 to 1.15
  const auto model_of = [&](double half) {
    Model model;
    add_free(model, "a", {1.0, Vector3d::Zero(), 0.1 * Eigen::Matrix3d::Identity()},
             Shape::box(Vector3d::Constant(2.0 * half)), {0.07, 0, 2.3}, 0.0);
    model.colliders.push_back({.name = "hills", .shape = Shape::height_field(heights, 4.0, 4.0), .friction = 0.0});
    model.contacts = {{"hills", "a"}};
    return model;
  };
  Batch<double> grown(compile(model_of(0.1), settings_of({Parameter::collider_size})), 1, {.threads = 1});
  grown.parameter(Parameter::collider_size).topRows(3) *= 10.0;
  Batch<double> own(compile(model_of(1.0), settings_of({})), 1, {.threads = 1});
  for (int i = 0; i < 80; ++i) grown.step(1), own.step(1);
  EXPECT_LT(own.root_poses()(2, 0), 2.05) << "it has not landed";
  EXPECT_NEAR(grown.root_poses()(2, 0), own.root_poses()(2, 0), 1e-3);
}

// A foot that a fixed joint holds has its place in the axes of its own link, wherever that is carried.
TEST(PlacesOf, colliders_on_fixed_links_are_in_the_axes_of_these) {
  const Pose mount =
                 Pose(Eigen::Translation3d(0.1, 0.2, -0.3)) * Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()),
             own = Pose(Eigen::Translation3d(0.05, 0.0, 0.1)) * Eigen::AngleAxisd(-0.4, Vector3d::UnitX());
  for (const bool floating : {true, false}) {
    Model model;
    model.links = {{"trunk", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())},
                   {"foot", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
    model.roots = {{"trunk", floating, at({0.0, 0.3, 1.0})}};
    Joint& joint = model.joints.emplace_back();
    joint.name = "ankle", joint.kind = JointKind::fixed, joint.parent = "trunk", joint.child = "foot";
    joint.origin = mount;
    const Vector3d foot = model.roots[0].pose * mount * own.translation();
    add_free(model, "ball", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero()), Shape::sphere(0.1),
             foot + Vector3d(0.05, 0.05, 0.05), 0.5);
    model.colliders.push_back({.name = "foot", .link = "foot", .shape = Shape::box({0.1, 0.2, 0.3}), .pose = own});
    model.contacts = {{"foot", "ball"}};
    Batch<double> batch(compile(model, settings_of({Parameter::collider_place})), 4, {.threads = 1});
    for (int e = 0; e < 4; ++e) {
      const double numbers[] = {0.01 * e, -0.01 * e, 0.005 * e, 0.3 * e};
      for (int k = 0; k < 4; ++k) batch.parameter(Parameter::collider_place)(4 + k, e) = numbers[k];
      Model moved = model;
      moved.colliders.back().pose = Pose(Eigen::Translation3d(numbers[0], numbers[1], numbers[2])) *
                                    Eigen::AngleAxisd(numbers[3], Vector3d::UnitZ()) * own;
      Batch<double> alone(compile(moved, settings_of({})), 1, {.threads = 1});
      const double gap = read(alone, Quantity::contact_gap)(0, 0);
      EXPECT_LT(gap, 0.0);
      EXPECT_NEAR(read(batch, Quantity::contact_gap)(0, e), gap, 1e-12) << floating << e;
    }
  }
}

}  // namespace
}  // namespace lockstep
