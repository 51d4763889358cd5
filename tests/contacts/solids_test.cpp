// Cylinders, ellipsoids and hulls in motion, against theory and against the shapes that they can stand for.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "physics.h"
#include "plan/program.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

template <class S>
struct Solids : testing::Test {
  static constexpr bool is_double = sizeof(S) == 8;
};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Solids, Precisions);

constexpr double radius = 0.04, length = 0.1, rate = 240.0;

// A cylinder of 1 kg on the plane, or on a box that stands in the world with its upper face where the plane was.
Model cylinder(bool on_box, double friction = 0.5) {
  Model model;
  const double across = (3 * radius * radius + length * length) / 12, along = radius * radius / 2;
  add_free(model, "cylinder", {1.0, Vector3d::Zero(), Vector3d(across, across, along).asDiagonal()},
           Shape::cylinder(radius, length), {0, 0, length / 2}, friction);
  if (on_box)
    model.colliders.push_back(
        {.name = "floor", .shape = Shape::box({4, 4, 0.2}), .pose = at({0, 0, -0.1}), .friction = friction});
  else
    add_floor(model, friction);
  model.contacts = {{"floor", "cylinder"}};
  return model;
}

// On its side, its axis along y.
Model lying(bool on_box, double friction = 0.5) {
  Model model = cylinder(on_box, friction);
  model.roots[0].pose = at({0, 0, radius});
  model.roots[0].pose.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()).toRotationMatrix();
  return model;
}

void tilt_gravity(Model& model, double angle) {
  model.gravity = {9.81 * std::sin(angle), 0.0, -9.81 * std::cos(angle)};
}

template <class S>
Batch<S> batch_of(const Model& model) {
  StepSettings settings;
  settings.dt = 1.0 / rate;
  return Batch<S>(compile(model, settings), 3, {.threads = 1});
}

template <class S>
Vector3d place(const Batch<S>& batch) {
  return batch.root_poses().col(0).head(3).template cast<double>();
}
template <class S>
Eigen::Quaterniond turn(const Batch<S>& batch) {
  const Eigen::Vector4d q = batch.root_poses().col(0).segment(3, 4).template cast<double>();
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized();
}
// Angular, then linear, in world axes.
template <class S>
Eigen::Matrix<double, 6, 1> velocity(const Batch<S>& batch) {
  const Eigen::Matrix<double, 6, 1> own = batch.root_velocities().col(0).template cast<double>();
  Eigen::Matrix<double, 6, 1> world;
  world << turn(batch) * own.head<3>(), turn(batch) * own.tail<3>();
  return world;
}

// The largest speed of any part in a second of rest.
template <class S>
double unrest(Batch<S>& batch) {
  double most = 0.0;
  for (int i = 0; i < rate; ++i) {
    batch.step(1);
    most = std::max(most, velocity(batch).tail(3).norm() + length * velocity(batch).head(3).norm());
  }
  return most;
}

TYPED_TEST(Solids, a_cylinder_that_is_dropped_tilted_comes_to_stand) {
  for (const bool on_box : {false, true}) {
    Model model = cylinder(on_box);
    model.roots[0].pose = at({0, 0, length / 2 + 0.01});
    model.roots[0].pose.linear() = Eigen::AngleAxisd(0.1, Vector3d(1, 2, 0).normalized()).toRotationMatrix();
    Batch<TypeParam> batch = batch_of<TypeParam>(model);
    batch.step(7 * static_cast<int>(rate));
    EXPECT_LT(unrest(batch), 5e-5) << on_box;
    EXPECT_NEAR(place(batch).z(), length / 2, 2e-5) << on_box;
    EXPECT_GT((turn(batch) * Vector3d::UnitZ()).z(), std::cos(1e-4)) << on_box;
    EXPECT_EQ(batch.faults()[0], Fault::none);
  }
}

TYPED_TEST(Solids, a_lying_cylinder_stays_where_it_lies) {
  for (const bool on_box : {false, true}) {
    Batch<TypeParam> batch = batch_of<TypeParam>(lying(on_box));
    batch.step(7 * static_cast<int>(rate));
    EXPECT_LT(unrest(batch), 5e-5) << on_box;
    EXPECT_LT(place(batch).head(2).norm(), 1e-4) << on_box;
  }
}

TYPED_TEST(Solids, a_rolling_cylinder_goes_on_rolling) {
  for (const bool on_box : {false, true}) {
    Model model = lying(on_box);
    const double speed = 0.4;
    model.roots[0].velocity << model.roots[0].pose.linear().transpose() * Vector3d(0, speed / radius, 0),
        model.roots[0].pose.linear().transpose() * Vector3d(speed, 0, 0);
    Batch<TypeParam> batch = batch_of<TypeParam>(model);
    batch.step(4 * static_cast<int>(rate));
    EXPECT_GT(velocity(batch)[3], 0.9999 * speed) << on_box;
    EXPECT_LT(velocity(batch)[3], 1.0001 * speed) << on_box;
    EXPECT_LT(std::abs(place(batch).y()), 1e-3) << on_box;
  }
}

// a = 2/3 g sin(slope) where it does not slip; upright it slides by g (sin - mu cos).
TYPED_TEST(Solids, a_cylinder_rolls_and_slides_down_a_slope_as_theory_says) {
  const double angle = 0.2, seconds = 1.0;
  for (const bool on_box : {false, true}) {
    Model rolls = lying(on_box);
    tilt_gravity(rolls, angle);
    Batch<TypeParam> rolling = batch_of<TypeParam>(rolls);
    rolling.step(static_cast<int>(seconds * rate));
    const double rolled = 2.0 / 3.0 * 9.81 * std::sin(angle) * seconds;
    EXPECT_NEAR(velocity(rolling)[3], rolled, 1e-3 * rolled) << on_box;

    const double friction = 0.1;
    Model slides = cylinder(on_box, friction);
    tilt_gravity(slides, angle);
    Batch<TypeParam> sliding = batch_of<TypeParam>(slides);
    sliding.step(static_cast<int>(seconds * rate));
    const double slid = 9.81 * (std::sin(angle) - friction * std::cos(angle)) * seconds;
    EXPECT_NEAR(velocity(sliding)[3], slid, 0.01 * slid) << on_box;
  }
}

// It falls over its lower rim where the slope is above r / (h / 2).
TYPED_TEST(Solids, a_cylinder_tips_at_the_slope_of_its_rim) {
  for (const bool on_box : {false, true})
    for (const double share : {0.97, 1.03}) {
      Model model = cylinder(on_box, 2.0);
      tilt_gravity(model, std::atan(share * radius / (length / 2)));
      Batch<TypeParam> batch = batch_of<TypeParam>(model);
      batch.step(2 * static_cast<int>(rate));
      const double upright = (turn(batch) * Vector3d::UnitZ()).z();
      EXPECT_EQ(upright > std::cos(0.01), share < 1.0) << on_box << " " << share;
    }
}

// A spheroid rocks about its lowest point by w^2 = m g (rho - c) / (I + m c^2), rho = a^2 / c the radius of curvature.
TYPED_TEST(Solids, an_ellipsoid_rocks_with_the_period_of_its_curvature) {
  const double a = 0.06, c = 0.03, own = (a * a + c * c) / 5;
  for (const bool on_box : {false, true}) {
    Model model;
    add_free(model, "egg", {1.0, Vector3d::Zero(), Vector3d(own, own, 0.4 * a * a).asDiagonal()},
             Shape::ellipsoid({a, a, c}), {0, 0, c}, 1.0);
    if (on_box)
      model.colliders.push_back(
          {.name = "floor", .shape = Shape::box({1, 1, 0.2}), .pose = at({0, 0, -0.1}), .friction = 1.0});
    else
      add_floor(model, 1.0);
    model.contacts = {{"floor", "egg"}};
    const double w = std::sqrt(9.81 * (a * a / c - c) / (own + c * c));
    model.roots[0].velocity << 0, 0.02 * w, 0, 0.02 * w * c, 0, 0;
    StepSettings settings;
    settings.dt = 1e-3;
    Batch<TypeParam> batch(compile(model, settings), 1, {.threads = 1});
    int crossings = 0, last = 0, first = 0;
    double before = 0.0;
    for (int i = 1; i <= 4000; ++i) {
      batch.step(1);
      const double tilt = (turn(batch) * Vector3d::UnitZ()).x();
      if (before < 0.0 && tilt >= 0.0) {
        if (crossings++ == 0) first = i;
        last = i;
      }
      before = tilt;
    }
    ASSERT_GT(crossings, 10) << on_box;
    const double period = 1e-3 * (last - first) / (crossings - 1), expected = 2 * std::acos(-1.0) / w;
    EXPECT_NEAR(period, expected, 0.01 * expected) << on_box;
  }
}

Eigen::Matrix3Xd corners_of(const Vector3d& edges) {
  Eigen::Matrix3Xd corners(3, 8);
  for (int i = 0; i < 8; ++i)
    corners.col(i) = 0.5 * edges.cwiseProduct(Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  return corners;
}

Model with_hulls(Model model) {
  for (Collider& collider : model.colliders)
    if (collider.shape.kind == ShapeKind::box) collider.shape = Shape::hull(corners_of(collider.shape.size));
  return model;
}

// Stacks of three blocks, the top one a hundred times as heavy.
TYPED_TEST(Solids, boxes_as_hulls_rest_where_boxes_rest) {
  for (const double top : {1.0, 100.0}) {
    Batch<TypeParam> boxes = batch_of<TypeParam>(stack(top)), hulls = batch_of<TypeParam>(with_hulls(stack(top)));
    boxes.step(1200), hulls.step(1200);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(static_cast<double>(boxes.root_poses()(7 * i + 2, 0)),
                  static_cast<double>(hulls.root_poses()(7 * i + 2, 0)), this->is_double ? 1e-6 : 2e-6)
          << i << " under " << top;
    double fastest = 0.0;
    for (int i = 0; i < 240; ++i) {
      hulls.step(1);
      fastest = std::max(fastest, static_cast<double>(hulls.root_velocities().col(0).abs().maxCoeff()));
    }
    EXPECT_LT(fastest, 5e-5) << top;
  }
}

// The frame of a hull may lie anywhere: its corners count.
TYPED_TEST(Solids, a_hull_does_not_mind_where_its_frame_is) {
  Model here = with_hulls(block());
  Model there = here;
  const Vector3d away(0.3, -0.2, 0.1);
  there.colliders[0].shape.points.colwise() += away;
  there.colliders[0].pose.translation() -= away;
  Batch<TypeParam> one = batch_of<TypeParam>(here), other = batch_of<TypeParam>(there);
  one.step(480), other.step(480);
  EXPECT_LT((place(one) - place(other)).norm(), 1e-6);
}

// The same where the frame is turned, too.
TYPED_TEST(Solids, a_hull_does_not_mind_how_its_frame_is_turned) {
  Model here = with_hulls(block());
  Model there = here;
  Pose seen = Pose::Identity();  // of the old frame
  seen.linear() = Eigen::AngleAxisd(0.8, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  seen.translation() = Vector3d(0.3, -0.2, 0.1);
  there.colliders[0].shape.points = seen * here.colliders[0].shape.points;
  there.colliders[0].pose = here.colliders[0].pose * seen.inverse();
  Batch<TypeParam> one = batch_of<TypeParam>(here), other = batch_of<TypeParam>(there);
  one.step(480), other.step(480);
  EXPECT_LT((place(one) - place(other)).norm(), 1e-6);
}

// Pads and object of the grasp as hulls: slip at most twice what boxes slip, and a micrometre.
TYPED_TEST(Solids, fingers_of_hulls_hold_what_fingers_of_boxes_hold) {
  const auto slip = [](const Model& model) {
    const Grasp grasp;
    StepSettings settings;
    settings.dt = 1.0 / rate;
    const Plan plan = compile(model, settings);
    Batch<TypeParam> batch(plan, 2, {.threads = 1});
    Vector3d first = Vector3d::Zero();
    double most = 0.0;
    for (int i = 0; i < 4 * rate; ++i) {
      const double t = (i + 1) / rate;
      const Eigen::Vector4d targets = grasp.targets(t);
      const char* const names[] = {"y", "z", "wrist", "left"};
      for (int k = 0; k < 4; ++k) batch.position_targets().row(plan.dof(names[k])) = static_cast<TypeParam>(targets[k]);
      batch.step(1);
      const Eigen::ArrayXd q = batch.positions().col(0).template cast<double>();
      Eigen::Isometry3d palm = at({0, q[plan.dof("y")], 0.03 + q[plan.dof("z")]});
      palm.linear() = Eigen::AngleAxisd(q[plan.dof("wrist")], Vector3d::UnitZ()).toRotationMatrix();
      const Vector3d seen = palm.inverse() * place(batch);
      if (t >= 1.0 && first.isZero(0.0)) first = seen;
      if (t >= 1.0) most = std::max(most, (seen - first).norm());
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
    return most;
  };
  const double of_boxes = slip(Grasp().model()), of_hulls = slip(with_hulls(Grasp().model()));
  EXPECT_LT(of_hulls, 2.0 * of_boxes + 1e-6) << of_boxes;
}

// A prism of 60 sides is a cylinder but for r (1 - cos(pi / 60)).
TYPED_TEST(Solids, a_prism_of_many_sides_stands_as_a_cylinder_does) {
  Model model = cylinder(false);
  Eigen::Matrix3Xd points(3, 60);
  for (int i = 0; i < 60; ++i) {
    const double angle = 2 * std::acos(-1.0) * (i / 2) / 30;
    points.col(i) << radius * std::cos(angle), radius * std::sin(angle), (i % 2 ? 0.5 : -0.5) * length;
  }
  model.colliders[0].shape = Shape::hull(points);
  model.roots[0].pose.linear() = Eigen::AngleAxisd(0.1, Vector3d(1, 2, 0).normalized()).toRotationMatrix();
  model.roots[0].pose.translation().z() += 0.01;
  Batch<TypeParam> batch = batch_of<TypeParam>(model);
  batch.step(7 * static_cast<int>(rate));
  EXPECT_LT(unrest(batch), 5e-5);
  EXPECT_NEAR(place(batch).z(), length / 2, 2e-5);
}

// Every environment on its own: a heap of all shapes, each environment with other velocities, in any order of lanes,
// batch and threads.
Model heap_of_all_shapes() {
  Model model = pile(3);
  const Inertia own{0.3, Vector3d::Zero(), 2e-4 * Eigen::Matrix3d::Identity()};
  add_free(model, "cylinder", own, Shape::cylinder(0.03, 0.08), {0.02, 0.01, 0.8}, 0.5);
  model.colliders.back().group = "bodies";
  add_free(model, "egg", own, Shape::ellipsoid({0.03, 0.04, 0.05}), {-0.02, 0.03, 0.95}, 0.5);
  model.colliders.back().group = "bodies";
  add_free(model, "hull", own, Shape::hull(corners_of({0.06, 0.08, 0.05}), 0.004), {0.01, -0.03, 1.1}, 0.5);
  model.colliders.back().group = "bodies";
  return model;
}

TYPED_TEST(Solids, a_heap_of_all_shapes_has_the_same_bits_anywhere) {
  const Plan plan = compile(heap_of_all_shapes(), StepSettings{.dt = 1.0 / rate});
  const auto run = [&](int environments, int threads, int shift) {
    Batch<TypeParam> batch(plan, environments, {.threads = threads});
    for (int e = 0; e < environments; ++e)
      for (int row = 0; row < batch.root_velocities().rows(); ++row)
        batch.root_velocities()(row, e) = static_cast<TypeParam>(0.3 * std::sin(1.7 * row + 0.9 * ((e + shift) % 37)));
    batch.step(360);
    Eigen::Array<TypeParam, Eigen::Dynamic, Eigen::Dynamic> poses = batch.root_poses();
    return poses;
  };
  const auto all = run(37, 2, 0), shifted = run(37, 1, 5);
  for (int e = 0; e < 37; ++e) EXPECT_TRUE((shifted.col(e) == all.col((e + 5) % 37)).all()) << e;
  EXPECT_TRUE((run(1, 1, 11).col(0) == all.col(11)).all());
  EXPECT_TRUE(all.isFinite().all());
}

// What boxes about two colliders part has no slot, and such a pair remembers nothing.
TYPED_TEST(Solids, boxes_about_colliders_change_no_bit) {
  const auto run = [](bool by_boxes) {
    const Plan plan = compile(heap_of_all_shapes(), StepSettings{.dt = 1.0 / rate});
    const Tables<TypeParam>& t = tables<TypeParam>(program_of(plan));
    int looked_at = 0;
    for (const Tables<TypeParam>* own : {&t, t.midpoint})
      for (int p = 0; own && p < own->contacts.pairs.count; ++p) {
        auto& pair = const_cast<TouchingPair<TypeParam>&>(own->contacts.pairs[p]);
        looked_at += pair.by_boxes, pair.by_boxes = pair.by_boxes && by_boxes;
      }
    EXPECT_GT(looked_at, 10);
    Batch<TypeParam> batch(plan, 21, {.threads = 1});
    for (int e = 0; e < 21; ++e)
      for (int row = 0; row < batch.root_velocities().rows(); ++row)
        batch.root_velocities()(row, e) = static_cast<TypeParam>(0.5 * std::sin(1.3 * row + 0.7 * e));
    batch.step(360);
    Eigen::Array<TypeParam, Eigen::Dynamic, Eigen::Dynamic> poses = batch.root_poses();
    return poses;
  };
  EXPECT_TRUE((run(true) == run(false)).all());
}

TEST(Hulls, that_are_none_are_refused_with_a_remedy) {
  const auto refused = [](const Eigen::Matrix3Xd& points, const std::string& words) {
    Model model = block();
    model.colliders[0].shape = Shape::hull(points);
    try {
      compile(model, {});
      ADD_FAILURE() << "not refused: " << words;
    } catch (const ModelError& error) {
      EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("collider 'block'"), std::string::npos) << error.what();
    }
  };
  const Eigen::Matrix3Xd cube = corners_of({0.1, 0.1, 0.1});
  Eigen::Matrix3Xd broken = cube, flat = cube, line = cube, ball(3, 200);
  broken(1, 2) = std::nan("");
  flat.row(2).setConstant(0.3);
  line.bottomRows(2).setConstant(0.3);
  for (int i = 0; i < 200; ++i) ball.col(i) = Vector3d(std::sin(i), std::sin(2.3 * i), std::sin(3.7 * i)).normalized();
  refused(cube.leftCols(3), "fewer than 4");
  refused(broken, "not finite");
  refused(flat, "in a plane");
  refused(line, "on a line");
  refused(Eigen::Matrix3Xd::Zero(3, 5), "in one place");
  refused(ball, "more than 64");
}

}  // namespace
}  // namespace lockstep
