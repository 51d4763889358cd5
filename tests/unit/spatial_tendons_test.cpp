// Spatial tendons against theory: orders of the integrators, ropes, pulleys, motors. SPDX-License-Identifier:
// Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/linearize.h"
#include "lockstep/plan.h"
#include "physics.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;

constexpr Integrator integrators[] = {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated,
                                      Integrator::runge_kutta};

StepSettings settings_of(Integrator integrator, double dt) {
  StepSettings settings;
  settings.integrator = integrator, settings.dt = dt;
  settings.guard = infinity;
  return settings;
}

Joint tendon_over(std::vector<TendonSegment> path) {
  Joint tendon;
  tendon.name = "tendon", tendon.kind = JointKind::tendon;
  tendon.path = std::move(path);
  return tendon;
}

// A ball of 2 kg that floats, on one line to the world's point (0, 0, 1).
Model pendulum(double length, double angle) {
  Model model;
  model.links = {{"ball", {2.0, Vector3d::Zero(), 0.002 * Eigen::Matrix3d::Identity()}}};
  Root root{"ball", true};
  root.pose.translation() = Vector3d(length * std::sin(angle), 0.0, 1.0 - length * std::cos(angle));
  model.roots = {root};
  model.joints = {tendon_over({{"", "ball", Vector3d(0, 0, 1), Vector3d::Zero()}})};
  return model;
}

// Two tumbling boxes and an arm, drawn together by a tendon over all of them. Nothing else acts.
Model tensegrity() {
  Model model;
  model.gravity.setZero();
  model.links = {{"one", Inertia::box(1.0, {0.3, 0.1, 0.2}, Vector3d::Zero())},
                 {"two", Inertia::box(0.7, {0.1, 0.4, 0.1}, Vector3d::Zero())},
                 {"base", {}}};
  Root one{"one", true}, two{"two", true};
  one.pose.translation() = Vector3d(0.5, 0.1, 0.0), two.pose.translation() = Vector3d(-0.3, 0.4, 0.2);
  one.velocity << 1.0, -2.0, 3.0, 0.1, 0.0, 0.2;
  two.velocity << -2.0, 1.0, 0.5, 0.0, 0.3, -0.1;
  model.roots = {one, two, {"base"}};
  physics::append_link(model, "base", Vector3d(0, 0, 0), Vector3d::UnitY(), 5.0).velocity = 2.0;
  const std::string arm = model.joints.back().child;
  model.joints.push_back(tendon_over({{"", "one", Vector3d(0, 0, 1), Vector3d(0.15, 0, 0.1)},
                                      {"one", "two", Vector3d(0.15, 0, 0.1), Vector3d(0, -0.2, 0), 0.5},
                                      {"two", arm, Vector3d(0, 0.2, 0), Vector3d(0.1, 0, 0), 0.5}}));
  Joint& tendon = model.joints.back();
  tendon.stiffness = 4.0, tendon.rest = 0.4;
  return model;
}

Eigen::VectorXd coordinates(const Batch<double>& batch) {
  Eigen::VectorXd all(batch.positions().rows() + batch.root_poses().rows());
  all << batch.positions().col(0).matrix(), batch.root_poses().col(0).matrix();
  return all;
}

// With that of the tendon's spring.
template <class S>
double energy(const Batch<S>& batch) {
  const Joint& tendon = batch.plan().model().joints.back();
  const double stretch = static_cast<double>(batch.positions()(batch.positions().rows() - 1, 0)) - tendon.rest;
  return static_cast<double>(batch.kinetic_energies()(0) + batch.potential_energies()(0)) +
         0.5 * tendon.stiffness * stretch * stretch;
}

TEST(SpatialTendons, keep_the_order_of_each_integrator) {
  const Model model = tensegrity();
  const auto at = [&](Integrator integrator, int steps) {
    Batch<double> batch(compile(model, settings_of(integrator, 0.5 / steps)), 1);
    batch.step(steps);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    return coordinates(batch);
  };
  const Eigen::VectorXd exact = at(Integrator::runge_kutta, 4000);
  int order = 0;
  for (const Integrator integrator : integrators) {
    SCOPED_TRACE(to_string(integrator));
    ++order;
    const double coarse = (at(integrator, 50) - exact).norm(), fine = (at(integrator, 100) - exact).norm();
    EXPECT_GT(std::log2(coarse / fine), order - 0.4);
    EXPECT_LT(fine, 0.2);
  }
}

TEST(SpatialTendons, springs_keep_energy) {
  const Model model = tensegrity();
  Batch<double> batch(compile(model, settings_of(Integrator::runge_kutta, 1e-3)), 1);
  const double before = energy(batch);
  batch.step(4000);
  EXPECT_NEAR(energy(batch), before, 1e-7 * before);
  Batch<float> single(compile(model, settings_of(Integrator::leapfrog, 1e-3)), 1);
  single.step(60000);
  EXPECT_NEAR(energy(single), before, 0.01 * before);
}

TEST(SpatialTendons, are_as_long_as_their_path_after_each_step_and_move_at_its_rate) {
  for (const Integrator integrator : integrators) {
    SCOPED_TRACE(to_string(integrator));
    Batch<double> batch(compile(tensegrity(), settings_of(integrator, 1e-3)), 1);
    constexpr double h = 1e-5;
    Batch<double> ahead(compile(tensegrity(), settings_of(Integrator::runge_kutta, h)), 1);
    for (int i = 0; i < 20; ++i) {
      batch.step();
      const double length = batch.positions()(1, 0), rate = batch.velocities()(1, 0);
      ahead.root_poses() = batch.root_poses(), ahead.root_velocities() = batch.root_velocities();
      ahead.positions() = batch.positions(), ahead.velocities() = batch.velocities();
      ahead.positions()(1, 0) = 17.0;  // it follows, whatever stands there
      ahead.step();
      EXPECT_NEAR((ahead.positions()(1, 0) - length) / h, 0.5 * (rate + ahead.velocities()(1, 0)), 1e-6);
    }
  }
}

TEST(SpatialTendons, a_rope_holds_a_swinging_ball) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    constexpr double length = 0.8, h = 1e-3;
    Model model = pendulum(length, 0.05);
    model.joints[0].upper = length;
    Batch<double> batch(compile(model, settings_of(integrator, h)), 1);
    double last = batch.root_poses()(0, 0), crossed = -1.0, period = 0.0;
    for (int i = 1; i <= 5000; ++i) {
      batch.step();
      EXPECT_LE(batch.positions()(0, 0), length + 1e-4);
      const double x = batch.root_poses()(0, 0);
      if (last < 0.0 && x >= 0.0) {
        const double time = h * (i - x / (x - last));
        if (crossed >= 0.0 && period == 0.0) period = time - crossed;
        crossed = time;
      }
      last = x;
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_NEAR(period, 2.0 * M_PI * std::sqrt(length / 9.81) * (1.0 + 0.05 * 0.05 / 16.0), 2e-3);
  }
}

TEST(SpatialTendons, a_slack_rope_lets_fall_and_then_holds_without_gaining_energy) {
  Model model = pendulum(0.3, 1.2);
  model.joints[0].upper = 0.8;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    Batch<double> batch(compile(model, settings_of(integrator, 1e-3)), 1);
    const double before = energy(batch);
    double longest = 0.0;
    for (int i = 0; i < 10000; ++i) {
      batch.step();
      longest = std::max(longest, batch.positions()(0, 0));
      ASSERT_LE(energy(batch), before + 1e-2);
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_GT(longest, 0.799);
    EXPECT_LE(longest, 0.8 + 1e-3);
  }
}

TEST(SpatialTendons, a_bungee_of_no_force_when_slack_swings_back_to_where_it_fell_from) {
  Model model = pendulum(0.3, 0.0);
  Joint& bungee = model.joints[0];
  bungee.upper = 0.5, bungee.limit_softness = Spring{400.0, 0.0};
  Batch<double> batch(compile(model, settings_of(Integrator::leapfrog, 1e-4)), 1);
  double lowest = 1.0, highest = 0.0;
  for (int i = 0; i < 20000; ++i) {
    batch.step();
    lowest = std::min(lowest, batch.root_poses()(2, 0));
    if (i > 5000) highest = std::max(highest, batch.root_poses()(2, 0));
  }
  // m g (0.2 + s) = k s^2 / 2
  const double weight = 2.0 * 9.81, s = (weight + std::sqrt(weight * weight + 2.0 * 400.0 * weight * 0.2)) / 400.0;
  EXPECT_NEAR(lowest, 1.0 - 0.5 - s, 5e-4);
  EXPECT_NEAR(highest, 0.7, 2e-3);
}

TEST(SpatialTendons, a_pulley_halves_the_force_that_lifts_a_weight) {
  // The weight hangs on two strands, of which half the length counts.
  Model model = pendulum(0.5, 0.0);
  model.joints[0] = tendon_over({{"", "ball", Vector3d(-0.1, 0, 1), Vector3d(-0.1, 0, 0), 0.5},
                                 {"", "ball", Vector3d(0.1, 0, 1), Vector3d(0.1, 0, 0), 0.5}});
  model.joints[0].effort = -2.0 * 9.81;  // pulls along half the sum, which is the weight's own way
  Batch<double> batch(compile(model, settings_of(Integrator::euler, 1e-3)), 1);
  batch.step(1000);
  EXPECT_NEAR(batch.root_poses()(2, 0), 0.5, 1e-9);
  model.joints[0].path[0].share = model.joints[0].path[1].share = 1.0;  // one rope over both
  model.joints[0].effort = -9.81;
  Batch<double> rope(compile(model, settings_of(Integrator::euler, 1e-3)), 1);
  rope.step(1000);
  EXPECT_NEAR(rope.root_poses()(2, 0), 0.5, 1e-9);
}

TEST(SpatialTendons, a_servo_with_a_limit_bends_an_elbow_to_where_the_lengths_say) {
  // A hinge at the origin, its link along x; the muscle goes from (0, 0, 0.1) to 0.1 along the link.
  Model model;
  model.gravity.setZero();
  model.links = {{"base", {}}};
  physics::append_link(model, "base", Vector3d::Zero(), Vector3d::UnitY(), 0.2);
  model.joints[0].damping = 0.02;
  model.joints.push_back(tendon_over({{"", model.joints[0].child, Vector3d(0, 0, 0.1), Vector3d(0.1, 0, 0)}}));
  Joint& muscle = model.joints.back();
  muscle.drive.kp = 500.0, muscle.drive.kd = 5.0, muscle.drive.position_target = 0.1;
  muscle.effort_limit = 5.0, muscle.velocity_limit = 0.3;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    StepSettings settings = settings_of(integrator, 1e-3);
    Batch<double> batch(compile(model, settings), 1);
    for (int i = 0; i < 3000; ++i) {
      batch.step();
      EXPECT_LE(std::abs(batch.velocities()(1, 0)), 0.3 + 1e-3);
    }
    // An equilateral triangle: the link has turned by 30 degrees towards z.
    EXPECT_NEAR(batch.positions()(1, 0), 0.1, 1e-5);
    EXPECT_NEAR(batch.positions()(0, 0), -M_PI / 6.0, 1e-4);
  }
}

// A crank of 0.1 m, 1e-3 rad from where it points away from the post at a distance of 1 m, so its cord is longest.
Model crank_near_its_dead_point() {
  Model model;
  model.gravity.setZero();
  model.links = {{"base", {}}};
  physics::append_link(model, "base", Vector3d::Zero(), Vector3d::UnitY(), 0.2).position = 1e-3;
  model.joints.push_back(tendon_over({{"", model.joints[0].child, Vector3d(-1, 0, 0), Vector3d(0.1, 0, 0)}}));
  return model;
}

// The joint moves by at most `reach` in each step, beside `share` of its velocity, until the tendon has the length.
void correct_in_small_steps(const Model& model, Integrator integrator, double length, double reach, double share) {
  Batch<double> batch(compile(model, settings_of(integrator, 2e-3)), 1);
  double before = batch.positions()(0, 0), most = 0.0;
  for (int i = 0; i < 2000; ++i) {
    batch.step();
    const double now = batch.positions()(0, 0), coasted = share * 2e-3 * std::abs(batch.velocities()(0, 0));
    most = std::max(most, std::abs(now - before) - coasted);
    before = now;
  }
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_LE(most, reach * (1.0 + 1e-9));
  EXPECT_GT(most, 0.2 * reach);
  EXPECT_NEAR(batch.positions()(1, 0), length, 1e-5);
}

TEST(SpatialTendons, move_no_joint_far_in_a_step_that_corrects_a_length) {
  Model ranged = crank_near_its_dead_point(), driven = ranged;
  ranged.joints.back().upper = 0.95;
  driven.joints.back().drive.kinematic = true, driven.joints.back().drive.position_target = 0.95;
  // A slider along x, on a cord to the point 1 m above where it stands.
  Model slider = crank_near_its_dead_point();
  slider.joints[0].kind = JointKind::prismatic, slider.joints[0].axis = Vector3d::UnitX();
  slider.joints.back().path = {{"", slider.joints[0].child, Vector3d(0, 0, 1), Vector3d::Zero()}};
  slider.joints.back().lower = 1.2;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    correct_in_small_steps(ranged, integrator, 0.95, 0.1, 1.0);
    correct_in_small_steps(driven, integrator, 0.95, 0.1, 0.0);  // what a drive asks for is a velocity
    correct_in_small_steps(slider, integrator, 1.2, 0.1 * 1.2, 1.0);
  }
}

// A block on a rail hangs by a loop of rope that a light free piece holds closed: where the piece comes to the block,
// the segment between them changes sides from step to step, and no row of one pose holds the weight.
TEST(SpatialTendons, whose_range_cannot_be_held_are_faults_before_they_are_far_from_it) {
  constexpr double upper = 0.7;
  Model model;
  model.links = {{"base", {}}, {"piece", Inertia::box(0.1, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
  Root piece{"piece", true};
  piece.pose.translation() = Vector3d(0.02, 0.0, -0.9);
  model.roots = {{"base"}, piece};
  Joint& rail = physics::append_link(model, "base", Vector3d::Zero(), -Vector3d::UnitZ(), 20.0);
  rail.kind = JointKind::prismatic, rail.position = 0.5;
  const std::string block = rail.child;
  model.joints.push_back(tendon_over(
      {{"", block, Vector3d::Zero(), Vector3d::Zero(), 0.5}, {block, "piece", Vector3d::Zero(), Vector3d::Zero()}}));
  model.joints.back().upper = upper;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    Batch<double> batch(compile(model, settings_of(integrator, 1.0 / 240.0)), 1);
    double longest = 0.0;
    for (int i = 0; i < 720; ++i) {
      batch.step();
      longest = std::max(longest, batch.positions()(1, 0));
    }
    EXPECT_EQ(batch.faults()[0], Fault::diverged);
    EXPECT_NE(batch.explain_fault(0).find("'tendon'"), std::string::npos) << batch.explain_fault(0);
    EXPECT_GT(longest, upper);
    EXPECT_LE(longest, 1.2 * upper);
  }
}

TEST(SpatialTendons, that_start_far_beyond_their_range_come_back) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    SCOPED_TRACE(to_string(integrator));
    Model model = pendulum(1.2, 0.4);
    model.joints[0].upper = 0.8;
    model.roots[0].velocity << 0.0, 0.0, 0.0, 2.0, 0.0, -1.0;  // sideways and outwards
    Batch<double> batch(compile(model, settings_of(integrator, 1.0 / 240.0)), 1);
    batch.step(480);
    EXPECT_EQ(batch.faults()[0], Fault::none);
    EXPECT_NEAR(batch.positions()(0, 0), 0.8, 0.01);
  }
}

TEST(SpatialTendons, give_the_same_bits_however_calls_are_divided) {
  Model model = tensegrity();
  model.joints.back().upper = 0.9;
  Joint& turning = model.joints.front();
  turning.velocity = 40.0;  // with whole turns
  for (const Integrator integrator : integrators) {
    if (integrator == Integrator::extrapolated || integrator == Integrator::runge_kutta)
      model.joints.back().upper = infinity;
    SCOPED_TRACE(to_string(integrator));
    const Plan plan = compile(model, settings_of(integrator, 2e-3));
    Batch<float> whole(plan, 5), parts(plan, 5);
    whole.step(400);
    for (int i = 0; i < 400; ++i) parts.step();
    EXPECT_TRUE((whole.positions() == parts.positions()).all());
    EXPECT_TRUE((whole.velocities() == parts.velocities()).all());
    EXPECT_TRUE((whole.root_poses() == parts.root_poses()).all());
  }
}

TEST(SpatialTendons, that_have_no_length_pull_at_nothing) {
  Model model = pendulum(0.0, 0.0);
  model.gravity.setZero();
  model.joints[0].stiffness = 100.0, model.joints[0].rest = 0.1;
  Batch<double> batch(compile(model, settings_of(Integrator::euler, 1e-3)), 1);
  batch.step(10);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(batch.positions()(0, 0), 0.0);
  EXPECT_TRUE(batch.root_velocities().isZero(0.0));
}

TEST(SpatialTendons, stand_where_a_reset_or_a_projection_puts_their_joints) {
  Model model = tensegrity();
  model.poses = {{"turned", {{model.joints[0].name, 0.7}}, {{model.joints[0].name, -1.0}}}};
  const Plan plan = compile(model, settings_of(Integrator::euler, 1e-3));
  Batch<double> batch(plan, 3), stepped(plan, 3);
  stepped.positions().row(0) = 0.7, stepped.velocities().row(0) = -1.0;
  stepped.project();
  batch.reset_to({1}, "turned");
  EXPECT_NEAR(batch.positions()(1, 1), stepped.positions()(1, 0), 1e-12);
  EXPECT_NEAR(batch.velocities()(1, 1), stepped.velocities()(1, 0), 1e-12);
  EXPECT_NE(batch.positions()(1, 0), batch.positions()(1, 1));
}

TEST(SpatialTendons, that_cannot_be_are_refused) {
  const auto refused = [](const std::function<void(Model&)>& change, const std::string& rule) {
    Model model = tensegrity();
    change(model);
    try {
      model.validate();
      ADD_FAILURE() << "not refused: " << rule;
    } catch (const ModelError& error) {
      EXPECT_NE(std::string(error.what()).find(rule), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("tendon"), std::string::npos) << error.what();
    }
  };
  refused([](Model& m) { m.joints.back().path[0].second = "tow"; }, "'tow', which does not exist");
  refused([](Model& m) { m.joints.back().path[0].share = 0.0; }, "share of a segment is not above 0");
  refused([](Model& m) { m.joints.back().path[0].first_point[1] = NAN; }, "first point");
  refused([](Model& m) { m.joints.back().armature = 0.1; }, "has an armature");
  refused([](Model& m) { m.joints.back().path = {{"", "base"}}; }, "length nothing changes");
  refused([](Model& m) { m.joints.back().path.clear(); }, "follows 0 couplings");
  refused([](Model& m) { m.couplings = {Coupling::mimic("tendon", "j0", 1.0)}; }, "a path, and yet follows a coupling");
  refused([](Model& m) { m.joints.front().path = m.joints.back().path; }, "is no tendon");
}

}  // namespace
}  // namespace lockstep
