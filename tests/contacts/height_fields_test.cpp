// Height fields: gaps against all triangles, motion against half-spaces, theory and places that differ.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "kernels/contacts/height_field.h"
#include "patches.h"
#include "physics.h"

namespace lockstep {
namespace {

using namespace contact_scenes;
using contacts_test::Random;
using Eigen::MatrixXd;

constexpr double rate = 240.0;

// Hills of some metres with heights of some centimetres.
MatrixXd hills(int rows, int columns, double height, unsigned seed) {
  Random random(seed);
  MatrixXd heights(rows, columns);
  for (double& number : heights.reshaped()) number = height * random.between(-1.0, 1.0);
  return heights;
}

MatrixXd plane_of(int rows, int columns, double edge_x, double slope) {
  return Eigen::RowVectorXd::LinSpaced(columns, -0.5 * slope * edge_x, 0.5 * slope * edge_x).replicate(rows, 1);
}

struct Fields : testing::Test {};

// A ball, or what a body of each kind is, and its inertia.
struct Body {
  const char* name;
  Shape shape;
  double height;  // of its centre at rest on its lowest side
};

Eigen::Matrix3Xd corners_of_wedge() {
  Eigen::Matrix3Xd points(3, 6);
  points << -0.06, 0.06, 0.06, -0.06, 0.0, 0.0, -0.05, -0.05, 0.05, 0.05, -0.02, 0.02, -0.03, -0.03, -0.03, -0.03, 0.05,
      0.05;
  return points;
}

const std::vector<Body>& bodies() {
  static const std::vector<Body> all = {{"ball", Shape::sphere(0.05), 0.05},
                                        {"capsule", Shape::capsule(0.03, 0.1), 0.08},
                                        {"box", Shape::box({0.12, 0.1, 0.08}), 0.04},
                                        {"cylinder", Shape::cylinder(0.05, 0.06), 0.03},
                                        {"egg", Shape::ellipsoid({0.05, 0.04, 0.03}), 0.03},
                                        {"wedge", Shape::hull(corners_of_wedge()), 0.03}};
  return all;
}

// Above the field's lowest point of rest by 2 cm.
Model falling(const Body& body, const Shape& ground, double friction, const Vector3d& spin) {
  Model model;
  const Inertia inertia{1.0, Vector3d::Zero(), Vector3d(2e-3, 1.8e-3, 2.2e-3).asDiagonal()};
  add_free(model, body.name, inertia, body.shape, {0.013, 0.021, body.height + 0.02}, friction);
  model.roots[0].velocity.head(3) = spin;
  model.roots[0].velocity[3] = 0.3;
  model.colliders.push_back({.name = "ground", .shape = ground, .friction = friction});
  model.contacts = {{"ground", body.name}};
  return model;
}

template <class S>
Batch<S> batch_of(const Model& model, ParameterSet declared = {}, int environments = 2) {
  StepSettings settings;
  settings.dt = 1.0 / rate;
  settings.per_environment = declared;
  return Batch<S>(compile(model, settings), environments, {.threads = 1});
}

double apart(const Batch<double>& a, const Batch<double>& b) {
  return (a.root_poses().col(0) - b.root_poses().col(0)).matrix().norm();
}

// The points of both are the same, so the motion is, to what the solver leaves.
TEST_F(Fields, a_level_field_is_a_half_space) {
  for (const Body& body : bodies()) {
    const Vector3d spin(0.4, -0.3, 0.2);
    Batch<double> plain = batch_of<double>(falling(body, Shape::half_space(), 0.5, spin)),
                  field =
                      batch_of<double>(falling(body, Shape::height_field(MatrixXd::Zero(9, 13), 1.5, 1.1), 0.5, spin));
    for (int i = 0; i < 60; ++i) {
      plain.step(1), field.step(1);
      ASSERT_LT(apart(plain, field), 1e-6) << body.name << ", step " << i;
    }
    EXPECT_LT(plain.root_poses()(2, 0), body.height + 0.015) << body.name << " has not landed";
  }
}

// A slope of heights is a half-space that leans, to which the world leans alike.
TEST_F(Fields, a_slope_is_a_half_space_that_leans) {
  const double slope = 0.3, angle = std::atan(slope);
  for (const Body& body : bodies()) {
    for (const double friction : {0.1, 0.8}) {
      Model on_plane = falling(body, Shape::half_space(), friction, Vector3d::Zero());
      on_plane.colliders.back().pose.linear() = Eigen::AngleAxisd(-angle, Vector3d::UnitY()).toRotationMatrix();
      on_plane.roots[0].pose.translation().z() += 0.03;
      Model on_field = on_plane;
      on_field.colliders.back().pose = Pose::Identity();
      on_field.colliders.back().shape = Shape::height_field(plane_of(31, 41, 4.0, slope), 4.0, 3.0);
      Batch<double> plain = batch_of<double>(on_plane), field = batch_of<double>(on_field);
      for (int i = 0; i < 80; ++i) plain.step(1), field.step(1);
      EXPECT_LT(apart(plain, field), 1e-5) << body.name << ", friction " << friction;
      EXPECT_EQ(field.faults()[0], Fault::none);
    }
  }
}

// An environment that stands elsewhere on the field is one whose field stands elsewhere.
TEST_F(Fields, places_that_differ_are_fields_that_stand_elsewhere) {
  const Shape ground = Shape::height_field(hills(17, 21, 0.03, 4), 2.0, 1.6);
  for (const Body& body : bodies()) {
    Model model = falling(body, ground, 0.6, Vector3d(0.2, 0.1, 0.0));
    model.roots[0].pose.translation().z() += 0.03;
    const int environments = 5;
    Batch<double> together = batch_of<double>(model, {Parameter::collider_place}, environments);
    auto place = together.parameter(Parameter::collider_place);
    const int row = 4 * static_cast<int>(model.colliders.size() - 1);
    Random random(5);
    std::vector<Batch<double>> alone;
    for (int e = 0; e < environments; ++e) {
      const Vector3d to(random.between(-0.3, 0.3), random.between(-0.3, 0.3), random.between(-0.01, 0.01));
      const double yaw = random.between(-3.0, 3.0);
      place.col(e).segment(row, 4) << to.x(), to.y(), to.z(), yaw;
      Model own = model;
      own.colliders.back().pose = Pose(Eigen::Translation3d(to) * Eigen::AngleAxisd(yaw, Vector3d::UnitZ()));
      alone.push_back(batch_of<double>(own, {}, 1));
    }
    for (int i = 0; i < 100; ++i) {
      together.step(1);
      for (int e = 0; e < environments; ++e) alone[e].step(1);
    }
    for (int e = 0; e < environments; ++e)
      EXPECT_LT((together.root_poses().col(e) - alone[e].root_poses().col(0)).matrix().norm(), 1e-7) << body.name;
  }
}

// A level that is moved under a robot at rest pushes it by the overlap that it makes, not by the way that it went.
TEST_F(Fields, a_field_that_is_moved_gives_no_kick) {
  const Model model =
      falling(bodies()[2], Shape::height_field(MatrixXd::Zero(41, 41), 4.0, 4.0), 0.8, Vector3d::Zero());
  Batch<double> batch = batch_of<double>(model, {Parameter::collider_place}, 1);
  batch.step(480);
  ASSERT_LT(batch.root_velocities().matrix().norm(), 1e-6);
  batch.parameter(Parameter::collider_place)(4, 0) = 0.5;
  for (int i = 0; i < 20; ++i) {
    batch.step(1);
    ASSERT_LT(batch.root_velocities().matrix().norm(), 1e-6) << i;
  }
}

// Tread and riser hold a ball at once, each with its own normal.
TEST_F(Fields, a_ball_rests_in_the_corner_of_a_stair) {
  MatrixXd stair = MatrixXd::Zero(9, 21);
  stair.rightCols(10).setConstant(0.15);
  Model model = falling(bodies()[0], Shape::height_field(stair, 2.0, 0.8), 0.0, Vector3d::Zero());
  model.gravity = {3.0, 0.0, -9.81};  // into the corner
  Batch<double> batch = batch_of<double>(model);
  batch.step(5 * static_cast<int>(rate));
  double unrest = 0.0;
  for (int i = 0; i < rate; ++i) {
    batch.step(1);
    unrest = std::max(unrest, batch.root_velocities().col(0).matrix().norm());
  }
  EXPECT_LT(unrest, 1e-4);
  // The riser's plane through x = 0 and 0.1: the ball is at its radius from it and from the tread.
  const double slope = std::atan2(0.15, 0.1), reach = 0.05 * std::tan(0.5 * slope);
  EXPECT_NEAR(batch.root_poses()(0, 0), -reach, 1e-3);
  EXPECT_NEAR(batch.root_poses()(2, 0), 0.05, 1e-3);
}

// What rolls over hills without friction keeps its energy.
TEST_F(Fields, a_ball_that_slides_over_waves_keeps_its_energy) {
  const int columns = 401;
  Eigen::RowVectorXd wave(columns);
  for (int i = 0; i < columns; ++i) wave[i] = 0.04 * std::cos(2.0 * M_PI * i / 100.0);
  Model model = falling(bodies()[0], Shape::height_field(wave.replicate(5, 1), 8.0, 2.0), 0.0, Vector3d::Zero());
  model.roots[0].pose = at({0.0, 0.0, 0.09});  // on a crest
  model.roots[0].velocity[3] = 0.6;
  Batch<double> batch = batch_of<double>(model);
  const auto energy = [&] {
    return 0.5 * batch.root_velocities().col(0).tail(3).matrix().squaredNorm() + 9.81 * batch.root_poses()(2, 0);
  };
  const double start = energy();
  double most = start, least = start;
  for (int i = 0; i < 3 * rate; ++i) {
    batch.step(1);
    most = std::max(most, energy()), least = std::min(least, energy());
  }
  EXPECT_GT(batch.root_poses()(0, 0), 2.0);
  EXPECT_LT(most - start, 0.02);
  EXPECT_GT(least - start, -0.1);  // slopes of 0.25 that change by a degree at each edge
}

TEST_F(Fields, beyond_the_edge_a_body_falls) {
  Model model = falling(bodies()[2], Shape::height_field(MatrixXd::Zero(5, 5), 0.4, 0.4), 0.5, Vector3d::Zero());
  model.roots[0].pose.translation().x() = 0.5;
  Batch<double> batch = batch_of<double>(model);
  batch.step(240);
  EXPECT_LT(batch.root_poses()(2, 0), -4.0);
  EXPECT_EQ(batch.faults()[0], Fault::none);
}

// A lying wheel meets a step with points ahead of its lowest line.
TEST_F(Fields, a_wheel_climbs_a_low_step_and_not_a_high_one) {
  for (const double step : {0.015, 0.12}) {
    MatrixXd ground = MatrixXd::Zero(9, 41);
    ground.rightCols(20).setConstant(step);
    Model model;
    add_free(model, "wheel", {1.0, Vector3d::Zero(), Vector3d(3e-3, 3e-3, 5e-3).asDiagonal()},
             Shape::cylinder(0.1, 0.05), {-0.3, 0.0, 0.1}, 0.9);
    model.roots[0].pose.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitX()).toRotationMatrix();
    model.roots[0].velocity << 0.0, 0.0, -7.0, 0.7, 0.0, 0.0;  // energy for 4 cm
    model.colliders.push_back({.name = "ground", .shape = Shape::height_field(ground, 2.0, 0.8), .friction = 0.9});
    model.contacts = {{"ground", "wheel"}};
    Batch<double> batch = batch_of<double>(model);
    double farthest = -1.0;
    for (int i = 0; i < 240; ++i) {
      batch.step(1);
      farthest = std::max(farthest, double{batch.root_poses()(0, 0)});
      ASSERT_GT(batch.root_poses()(2, 0), 0.08) << "it sinks into the step at " << batch.root_poses()(0, 0);
    }
    if (step < 0.05) {
      EXPECT_GT(farthest, 0.15);
    } else {
      EXPECT_LT(farthest, 0.05);
    }
  }
}

// Contacts are read as one, whatever the number of points.
TEST_F(Fields, the_forces_of_all_points_are_those_of_the_contact) {
  const Model model = falling(bodies()[2], Shape::height_field(MatrixXd::Zero(9, 9), 1.0, 1.0), 0.5, Vector3d::Zero());
  StepSettings settings;
  settings.dt = 1.0 / rate;
  settings.record_contacts = true;
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  batch.step(480);
  ASSERT_EQ(batch.plan().contacts().size(), 1u);
  EXPECT_EQ(batch.plan().contacts()[0].slots, 4);
  EXPECT_NEAR(read(batch, Quantity::contact_force)(2, 0), 9.81, 1e-3);
  EXPECT_NEAR(read(batch, Quantity::contact_mean_force)(2, 0), 9.81, 0.05);
}

}  // namespace
}  // namespace lockstep
