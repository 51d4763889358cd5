// Ball joints against theory: closed forms, ends of ranges, turns beyond pi. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/inverse_kinematics.h"
#include "lockstep/linearize.h"
#include "lockstep/plan.h"
#include "model/rotations.h"
#include "physics.h"
#include "reference/loops.h"
#include "reference/step.h"
#include "reference/truth.h"

namespace lockstep {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr Integrator integrators[] = {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated,
                                      Integrator::runge_kutta};

// A body that a ball joint holds at its centre of mass, without gravity.
Model top_of(const Vector3d& moments, const Vector3d& position, const Vector3d& velocity) {
  Model model;
  model.name = "top";
  model.gravity.setZero();
  model.links = {{"base", {}}, {"top", {1.0, Vector3d::Zero(), moments.asDiagonal()}}};
  const int first = model.add_ball("ball", "base", "top", Pose(Eigen::Translation3d(0.1, 0.2, 0.3)));
  for (int k = 0; k < 3; ++k) {
    model.joints[static_cast<std::size_t>(first + k)].position = position[k];
    model.joints[static_cast<std::size_t>(first + k)].velocity = velocity[k];
  }
  return model;
}

StepSettings settings_of(Integrator integrator, double dt) {
  StepSettings settings;
  settings.integrator = integrator, settings.dt = dt;
  settings.guard = infinity;
  return settings;
}

template <class S>
Vector3d position_of(const Batch<S>& batch, int e = 0) {
  return batch.positions().col(e).head(3).matrix().template cast<double>();
}
template <class S>
Vector3d velocity_of(const Batch<S>& batch, int e = 0) {
  return batch.velocities().col(e).head(3).matrix().template cast<double>();
}

// rad
double angle_between(const Vector3d& one, const Vector3d& other) {
  return rotation_vector(turned_by(one).conjugate() * turned_by(other)).norm();
}

// A symmetric top turns about its angular momentum at L / I, and about its axis at (1 - I_3 / I) w_3.
Vector3d symmetric_top(const Vector3d& moments, const Vector3d& position, const Vector3d& velocity, double time) {
  const Vector3d momentum = turned_by(position) * moments.cwiseProduct(velocity).eval();
  const Quaterniond before = turned_by(momentum * (time / moments[0])),
                    behind = turned_by(Vector3d(0, 0, (1.0 - moments[2] / moments[0]) * velocity[2] * time));
  return rotation_vector(before * turned_by(position) * behind);
}

TEST(BallTop, moves_by_its_closed_form_in_the_order_of_each_integrator) {
  const Vector3d moments(0.02, 0.02, 0.03), position(0.4, -1.0, 0.7), velocity(1.0, -2.0, 4.0);
  const Model model = top_of(moments, position, velocity);
  for (const Integrator integrator : integrators) {
    SCOPED_TRACE(to_string(integrator));
    double errors[2];
    for (int halved = 0; halved < 2; ++halved) {
      const int steps = 400 << halved;
      Batch<double> batch(compile(model, settings_of(integrator, 2.0 / steps)), 1);
      batch.step(steps);
      errors[halved] = angle_between(position_of(batch), symmetric_top(moments, position, velocity, 2.0));
    }
    const double order = integrator == Integrator::euler          ? 1.0
                         : integrator == Integrator::leapfrog     ? 2.0
                         : integrator == Integrator::extrapolated ? 3.0
                                                                  : 4.0;
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.25) << errors[0];
    EXPECT_LT(errors[0], integrator == Integrator::euler ? 0.1 : 2e-3);
  }
}

TEST(BallTop, keeps_its_energy_and_momentum_for_a_minute) {
  const Vector3d moments(0.02, 0.03, 0.045), position(0.1, 0.2, 0.3), velocity(0.05, 6.0, 0.05);  // tumbles
  Batch<float> batch(compile(top_of(moments, position, velocity), settings_of(Integrator::leapfrog, 0.002)), 1);
  const auto energy = [&] { return moments.dot(velocity_of(batch).cwiseAbs2()); };
  const auto momentum = [&]() -> Vector3d {
    return turned_by(position_of(batch)) * moments.cwiseProduct(velocity_of(batch)).eval();
  };
  const double first = energy();
  const Vector3d start = momentum();
  int tumbled = 0;
  for (int i = 0; i < 3000; ++i) {
    batch.step(10);
    tumbled += velocity_of(batch)[1] < 0.0;
    ASSERT_NEAR(energy(), first, 1e-3 * first) << i;
    ASSERT_LT((momentum() - start).norm(), 1e-2 * start.norm()) << i;
  }
  EXPECT_GT(tumbled, 500);
  EXPECT_LT(tumbled, 2500);
}

// Whole turns about a tilted axis. The positions stay within pi.
TEST(BallTop, turns_for_ever) {
  const Vector3d axis = Vector3d(1.0, 2.0, -1.0).normalized();
  for (const Integrator integrator : integrators) {
    Batch<float> batch(
        compile(top_of(Vector3d::Constant(0.02), Vector3d::Zero(), 5.0 * axis), settings_of(integrator, 1.0 / 256)), 3);
    for (int i = 1; i <= 60 * 4; ++i) {
      batch.step(64);
      const double angle = std::remainder(5.0 * 0.25 * i, 2.0 * M_PI);
      ASSERT_LT(angle_between(position_of(batch, 2), angle * axis), 1e-4 * (1.0 + 0.05 * i)) << to_string(integrator);
      ASSERT_LE(position_of(batch).norm(), M_PI + 1e-5);
    }
  }
}

// About one axis, a spring makes harmonic motion of any amplitude.
TEST(BallSpring, swings_in_its_period) {
  const Vector3d axis = Vector3d(2.0, -1.0, 1.0).normalized();
  Model model = top_of(Vector3d::Constant(0.02), 2.5 * axis, Vector3d::Zero());
  for (Joint& joint : model.joints) joint.stiffness = 0.5;
  const double rate = std::sqrt(0.5 / 0.02);
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated}) {
    Batch<double> batch(compile(model, settings_of(integrator, 0.001)), 1);
    for (int i = 1; i <= 40; ++i) {
      batch.step(50);
      EXPECT_LT((position_of(batch) - 2.5 * std::cos(rate * 0.05 * i) * axis).norm(), 2e-3) << to_string(integrator);
    }
  }
}

TEST(BallServo, holds_its_target) {
  Model model = top_of({0.02, 0.03, 0.01}, {0.5, 0.0, -0.5}, Vector3d::Zero());
  const Vector3d target(1.0, -1.2, 0.6);
  for (int k = 0; k < 3; ++k) {
    Drive& drive = model.joints[static_cast<std::size_t>(k)].drive;
    drive.kp = 5.0, drive.kd = 0.5, drive.position_target = target[k];
    model.joints[static_cast<std::size_t>(k)].effort_limit = 2.0;
  }
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<float> batch(compile(model, settings_of(integrator, 0.002)), 1);
    batch.step(1500);
    EXPECT_LT((position_of(batch) - target).norm(), 1e-3);
    EXPECT_LT(velocity_of(batch).norm(), 1e-3);
  }
}

// A rod that hangs on a ball and may lean by half a radian.
Model leaning_rod(double restitution) {
  Model model = top_of({0.02, 0.02, 0.03}, Vector3d::Zero(), Vector3d::Zero());
  model.gravity = {4.0, 3.0, -2.0};
  model.links[1].inertia.center = {0.0, 0.0, -0.2};
  model.joints[0].upper = 0.5, model.joints[0].restitution = restitution;
  return model;
}

TEST(BallRange, is_kept_and_rested_against) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    const int n = 16;
    Batch<float> batch(compile(leaning_rod(0.0), settings_of(integrator, 0.002)), n);
    std::mt19937 random(3);
    std::uniform_real_distribution<float> speed(-4.0f, 4.0f);
    for (int e = 0; e < n; ++e)
      for (int k = 0; k < 3; ++k) batch.velocities()(k, e) = speed(random);
    for (int i = 0; i < 2000; ++i) {
      batch.step();
      for (int e = 0; e < n; ++e) ASSERT_LT(position_of(batch, e).norm(), 0.5 + 1e-3) << i;
    }
    ASSERT_EQ(batch.faulted(), 0);
    // Without damping it still swings along the edge of its cone. With some it rests where gravity leans it.
    Model damped = leaning_rod(0.0);
    for (Joint& joint : damped.joints) joint.damping = 0.05;
    Batch<float> still(compile(damped, settings_of(integrator, 0.002)), 1);
    still.step(5000);
    const Vector3d rest = position_of(still);
    EXPECT_NEAR(rest.norm(), 0.5, 1e-4);
    // The lever's torque and that of the stop are opposite: the lever leans in the plane of gravity.
    EXPECT_LT(std::abs(rest.normalized().dot(Vector3d(4.0, 3.0, -2.0).normalized())), 1e-2);
    still.step(5000);
    EXPECT_LT((position_of(still) - rest).norm(), 1e-5);
  }
}

TEST(BallRange, gives_back_a_share_of_the_speed) {
  Model model = leaning_rod(0.6);
  model.gravity.setZero();
  model.joints[0].velocity = 1.2, model.joints[1].velocity = -0.9;
  model.links[1].inertia.center.setZero();
  model.links[1].inertia.about_center = Vector3d::Constant(0.01).asDiagonal();
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(model, settings_of(integrator, 0.002)), 1);
    batch.step(300);
    EXPECT_LT((velocity_of(batch) - Vector3d(-0.72, 0.54, 0.0)).norm(), 1e-6) << to_string(integrator);
  }
}

TEST(BallRange, as_a_spring_pushes_back) {
  Model model = leaning_rod(0.0);
  model.joints[0].limit_softness = Spring{50.0, 0.5};
  for (Joint& joint : model.joints) joint.damping = 0.05;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(model, settings_of(integrator, 0.002)), 1);
    batch.step(10000);
    const Vector3d rest = position_of(batch);
    // m g l sin of the angle between the rod and gravity.
    const Vector3d rod = turned_by(rest) * Vector3d(0.0, 0.0, -0.2);
    EXPECT_NEAR(50.0 * (rest.norm() - 0.5), rod.cross(model.gravity).norm(), 1e-3) << to_string(integrator);
  }
}

// A rod on a ball, a rod on a hinge behind it, whose end a loop holds to the base.
Model closed_chain() {
  Model model;
  model.links = {{"base", {}},
                 {"first", Inertia::box(0.5, {0.5, 0.04, 0.03}, {0.25, 0, 0})},
                 {"second", Inertia::box(0.4, {0.4, 0.03, 0.05}, {0.2, 0, 0})}};
  const int first = model.add_ball("ball", "base", "first");
  const double position[] = {0.2, -0.8, 0.3}, velocity[] = {0.9, 0.0, 0.0};
  for (int k = 0; k < 3; ++k) {
    Joint& joint = model.joints[static_cast<std::size_t>(first + k)];
    joint.position = position[k], joint.velocity = velocity[k];
  }
  Joint hinge;
  hinge.name = "hinge", hinge.kind = JointKind::continuous, hinge.parent = "first", hinge.child = "second";
  hinge.axis = Vector3d::UnitY(), hinge.origin.translation().x() = 0.5, hinge.position = 1.9;
  model.joints.push_back(hinge);
  Loop loop;
  loop.name = "held", loop.first = "base", loop.second = "second";
  loop.second_pose.translation().x() = 0.4;
  const std::vector<Eigen::Isometry3d> poses = reference::Mechanism([&] {
                                                 Model open = model;
                                                 open.loops.clear();
                                                 return open;
                                               }())
                                                   .link_poses(reference::Mechanism(model).initial_state());
  loop.first_pose.translation() = poses[2] * Vector3d(0.4, 0, 0);
  model.loops.push_back(loop);
  return model;
}

TEST(BallLoop, steps_of_euler_are_those_of_the_reference) {
  StepSettings settings = settings_of(Integrator::euler, 0.002);
  settings.method = Method::reduced;
  const Plan plan = compile(closed_chain(), settings);
  Batch<double> batch(plan, 1);
  const reference::Mechanism mechanism(plan.model());
  reference::State state = mechanism.initial_state();
  for (int i = 0; i < 20; ++i) {
    state = reference::step(mechanism, settings, state, mechanism.initial_inputs()).state;
    batch.step();
    const reference::State ours = physics::state_of(batch);
    EXPECT_LT(physics::distance(ours.q, state.q), 1e-8) << i;
    EXPECT_LT(physics::distance(ours.v, state.v), 1e-7) << i;
  }
}

TEST(BallLoop, moves_exactly_in_the_order_of_each_integrator_and_stays_closed) {
  const Plan closed = compile(closed_chain(), settings_of(Integrator::euler, 0.002));
  const reference::Mechanism mechanism(closed.model());
  const reference::State truth =
      reference::integrate(mechanism, mechanism.initial_state(), reference::held, 0.25, 1, 1500).end;
  for (const auto& [integrator, order] : {std::pair{Integrator::euler, 1.0}, std::pair{Integrator::leapfrog, 2.0}}) {
    SCOPED_TRACE(to_string(integrator));
    double errors[2];
    for (int halved = 0; halved < 2; ++halved) {
      const int steps = 250 << halved;
      Batch<double> batch(compile(closed.model(), settings_of(integrator, 0.25 / steps)), 1);
      batch.step(steps);
      const reference::State ours = physics::state_of(batch);
      errors[halved] = std::max(physics::distance(ours.q, truth.q), physics::distance(ours.v, truth.v));
      batch.step(20 * steps);
      ASSERT_EQ(batch.faulted(), 0);
      EXPECT_LT(reference::loop_rows(mechanism, physics::state_of(batch)).error.lpNorm<Eigen::Infinity>(), 1e-4);
    }
    EXPECT_NEAR(std::log2(errors[0] / errors[1]), order, 0.2) << errors[0];
  }
}

// Mass matrix, bias forces, and accelerations of links, by other derivations than a step's.
TEST(BallReadings, are_those_of_the_reference) {
  Model model = closed_chain();
  model.loops.clear();
  StepSettings settings = settings_of(Integrator::euler, 1e-6);
  settings.record_accelerations = true;
  const Plan plan = compile(model, settings);
  Batch<double> batch(plan, 1);
  const double velocity[] = {1.5, -2.0, 1.0, 0.7};
  for (int i = 0; i < 4; ++i) batch.velocities()(i, 0) = velocity[i];
  const reference::Mechanism mechanism(model);
  const reference::State state = physics::state_of(batch);
  const Eigen::MatrixXd mass = mechanism.mass_matrix(state);
  const Eigen::VectorXd bias = mechanism.bias(state);
  const auto ours = batch.mass_matrices();
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) EXPECT_NEAR(ours(4 * i + j, 0), mass(i, j), 1e-12);
  EXPECT_LT(physics::distance(batch.bias_forces().col(0).matrix(), bias), 1e-12);

  batch.step();
  Eigen::VectorXd damping = mechanism.damping().cwiseProduct(state.v);
  const Eigen::VectorXd acceleration = mass.llt().solve(-bias - damping);
  const Query query{Quantity::link_acceleration, {mechanism.model().link_index("second")}};
  Batch<double>::Array read(6, 1);
  batch.read(std::span(&query, 1), {read.data(), read.outerStride(), 1});
  const int link = mechanism.model().link_index("second");
  Eigen::VectorXd wanted = mechanism.jacobian(state, link) * acceleration + mechanism.acceleration(state, link);
  wanted.tail<3>() -= model.gravity;  // as an accelerometer sees it, in the link's axes
  const Eigen::Matrix3d turn = mechanism.link_poses(state)[static_cast<std::size_t>(link)].linear().transpose();
  wanted << turn * wanted.head<3>(), turn * wanted.tail<3>();
  EXPECT_LT(physics::distance(read.col(0).matrix(), wanted), 1e-3 * wanted.norm());
}

TEST(BallKinematics, reach_poses_within_the_range) {
  Model model = closed_chain();
  model.loops.clear();
  model.joints[0].upper = 1.5;
  model.add_site("tip", "second", Pose(Eigen::Translation3d(0.4, 0, 0)));
  const Plan plan = compile(model, settings_of(Integrator::euler, 0.002));
  const int n = 200;
  Batch<double> batch(plan, n), targets(plan, n);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  for (int e = 0; e < n; ++e) {
    const Vector3d turn = 1.4 * std::cbrt(std::abs(number(random))) *
                          Vector3d(number(random), number(random), number(random)).normalized();
    for (int k = 0; k < 3; ++k) targets.positions()(k, e) = turn[k];
    targets.positions()(3, e) = 1.0 + number(random);
  }
  const Query query{Quantity::site_pose, {0}};
  Batch<double>::Array wanted(7, n);
  targets.read(std::span(&query, 1), {wanted.data(), wanted.outerStride(), 1});
  const auto left = batch.inverse_kinematics(0, wanted.topRows(3));
  int reached = 0;
  for (int e = 0; e < n; ++e) {
    reached += left(0, e) < 1e-5;
    EXPECT_LE(position_of(batch, e).norm(), 1.5 + 1e-9);
  }
  EXPECT_GT(reached, 190);
}

TEST(BallModel, refuses_what_is_no_ball) {
  const auto refusal = [](const auto& change) -> std::string {
    Model model = top_of({0.02, 0.02, 0.03}, Vector3d::Zero(), Vector3d::Zero());
    change(model);
    try {
      model.validate();
    } catch (const ModelError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal([](Model&) {}), "");
  const std::pair<std::function<void(Model&)>, const char*> cases[] = {
      {[](Model& m) {
         m.joints[1].axis = {0, 1, 1};
       },
       "axis is not x, y or z"},
      {[](Model& m) { std::swap(m.joints[0], m.joints[1]); }, "do not follow each other"},
      {[](Model& m) { m.joints.pop_back(); }, "do not follow each other"},
      {[](Model& m) { m.joints[1].origin.translation().x() = 0.1; }, "do not follow each other"},
      {[](Model& m) { m.joints[0].lower = -1.0; }, "does not begin at 0"},
      {[](Model& m) { m.joints[1].upper = 1.0; }, "has a range, which the first part has for all"},
      {[](Model& m) {
         m.joints[0].upper = 1.0, m.joints[0].limit_softness = Frequency{10, 1};
       },
       "by frequency"},
      {[](Model& m) { m.joints[2].drive.kinematic = true; }, "drive is kinematic"},
      {[](Model& m) { m.joints[2].rest = 0.1; }, "rest position"},
      {[](Model& m) { m.links[2].inertia.mass = 0.1; }, "has a mass or an inertia"},
      {[](Model& m) { m.add_site("on", "ball.x"); }, "bears a site"},
      {[](Model& m) { m.couplings.push_back(Coupling::mimic("ball.x", "ball.y", 1.0)); }, "a part of a ball joint"}};
  for (const auto& [change, words] : cases) EXPECT_NE(refusal(change).find(words), std::string::npos) << words;
  Model model = top_of({0.02, 0.02, 0.03}, Vector3d::Zero(), Vector3d::Zero());
  EXPECT_THROW(model.add_ball("ball", "base", "top"), ModelError);
  EXPECT_THROW(model.add_ball("", "base", "top"), ModelError);
}

TEST(BallRange, of_half_a_turn_or_more_holds_nothing) {
  const Vector3d moments(0.02, 0.02, 0.02), spin(0.0, 20.0, 0.0);
  for (const double upper : {M_PI, 3.5})
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
      Model model = top_of(moments, Vector3d::Zero(), spin);
      model.joints[0].upper = upper;
      Batch<double> batch(compile(model, settings_of(integrator, 1.0 / 240)), 1);
      batch.step(100);
      EXPECT_LT((velocity_of(batch) - spin).norm(), 1e-9) << upper;
    }
}

TEST(BallRange, beside_a_bound_along_it_leaves_no_singular_matrix) {
  Model model = top_of(Vector3d(0.02, 0.02, 0.02), Vector3d(0.4, 0.0, 0.0), Vector3d(3.0, 0.0, 0.0));
  model.joints[0].upper = 0.4, model.joints[0].velocity_limit = 0.01;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(model, settings_of(integrator, 1.0 / 240)), 1);
    batch.step(50);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_LT(position_of(batch).norm(), 0.42);
  }
}

TEST(BallRange, is_that_of_the_angle_in_readings_and_starts) {
  Model model = top_of(Vector3d(0.02, 0.02, 0.02), Vector3d::Zero(), Vector3d::Zero());
  model.joints[0].upper = 0.5;
  model.poses = {{"rest"}};
  Batch<double> batch(compile(model, settings_of(Integrator::euler, 1.0 / 240)), 64);
  batch.positions().row(1) = -2.0;
  EXPECT_NEAR(batch.limit_violations()(0, 3), 1.5, 1e-12);
  batch.reset_to(EnvironmentSet::all(), "rest", {.position = 0.5});
  EXPECT_LE(batch.limit_violations().maxCoeff(), 1e-12);
  EXPECT_GT(batch.positions().abs().maxCoeff(), 0.3);
}

// A step that ends beyond pi gives the opposite vector.
TEST(BallDerivatives, are_finite_where_a_step_passes_half_a_turn) {
  const double h = 1.0 / 240;
  const Model model = top_of(Vector3d(0.02, 0.02, 0.02), Vector3d(3.1416 - h, 0.0, 0.0), Vector3d(1.0, 0.0, 0.0));
  Batch<double> batch(compile(model, settings_of(Integrator::euler, h)), 1);
  EXPECT_LT(batch.linearize()[0].state_by_state.cwiseAbs().maxCoeff(), 10.0);
}

TEST(BallJoints, are_added_whole_or_not_at_all_and_by_names_of_the_models_own_elements) {
  Model model = top_of(Vector3d(0.02, 0.02, 0.02), Vector3d::Zero(), Vector3d::Zero());
  model.links.push_back({"foot", {1.0, Vector3d::Zero(), 0.02 * Eigen::Matrix3d::Identity()}});
  model.links.shrink_to_fit();
  model.add_ball("ankle", model.links[1].name, model.links.back().name);
  EXPECT_EQ(model.joints[3].parent, "top");
  EXPECT_EQ(model.joints[5].child, "foot");
  model.joints[2].name = "knee.z";
  EXPECT_THROW(model.add_ball("knee", "foot", "shank"), ModelError);
  EXPECT_EQ(model.joints.size(), 6u);
}

}  // namespace
}  // namespace lockstep
