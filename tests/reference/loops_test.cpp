// Closed loops of the reference against theory, differences and equal trees. SPDX-License-Identifier: Apache-2.0
//
// One file: rows, exact motion and steps are tested on the same mechanisms, by the same helpers.
#include "reference/loops.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "loop_models.h"
#include "physics.h"
#include "reference/integrators.h"
#include "reference/loop_step.h"
#include "reference/truth.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using physics::distance;
using namespace loop_models;

StepSettings settings(double dt, Integrator integrator = Integrator::euler) {
  StepSettings result;
  result.method = Method::reduced;
  result.integrator = integrator;
  result.dt = dt;
  return result;
}

State after_step(const Mechanism& mechanism, const StepSettings& step_settings, const State& state, int chords = 1) {
  if (step_settings.integrator == Integrator::euler)
    return step(mechanism, step_settings, state, mechanism.initial_inputs()).state;
  return integrated(
      mechanism, step_settings, state, [](double, Inputs&) {}, chords);
}

// The energy of the motion without drives, with that of the springs.
double energy(const Mechanism& mechanism, const State& state) {
  double energy = mechanism.kinetic_energy(state) + mechanism.potential_energy(state);
  for (int i = 0; i < mechanism.dofs(); ++i)
    energy += 0.5 * mechanism.joint(i).stiffness * std::pow(state.q[i] - mechanism.joint(i).rest, 2);
  return energy;
}

// Moved at random by up to `amount` in each velocity, with random velocities.
State scattered(const Mechanism& mechanism, std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  const auto numbers = [&] {
    return VectorXd(VectorXd::NullaryExpr(mechanism.velocities(), [&] { return number(random); }));
  };
  State state = mechanism.advanced(mechanism.initial_state(), amount * numbers(), 1.0);
  state.v = 3.0 * numbers();
  return state;
}

// A wheel that turns on the ground, and a body on it: a loop of a kind holds it, or the joints that do the same.
struct Carried {
  Model loop, tree;
};
Carried carried(LoopKind kind, bool body_first) {
  const Inertia wheel = Inertia::box(2.0, {0.5, 0.3, 0.1}, {0.02, 0.0, 0.05});
  const Inertia body = Inertia::box(1.0, {0.1, 0.2, 0.3}, {0.03, 0.02, -0.04});
  const Vector3d axis = Vector3d(1.0, 2.0, -2.0) / 3.0;
  Pose on_wheel = at(Vector3d(0.2, 0.1, 0.05)), on_body = at(Vector3d(-0.05, 0.1, 0.02));
  on_wheel.rotate(Eigen::AngleAxisd(0.7, Vector3d(2.0, -1.0, 2.0) / 3.0));
  on_body.rotate(Eigen::AngleAxisd(-0.4, Vector3d(0.0, 0.6, 0.8)));

  Carried both{on_ground("loop"), on_ground("tree")};
  for (Model* model : {&both.loop, &both.tree})
    add(*model, "wheel", wheel, JointKind::revolute, "ground", Pose::Identity(), {0.0, 0.6, 0.8}, 0.3, 4.0);
  std::string parent = "wheel";
  Pose origin = on_wheel;
  const auto joint = [&](JointKind joint_kind, const Vector3d& along, double velocity) {
    const std::string name = "carrier" + std::to_string(both.tree.joints.size());
    add(both.tree, name, {}, joint_kind, parent, origin, along, 0.0, velocity);
    parent = name, origin = Pose::Identity();
  };
  switch (kind) {
    case LoopKind::point:
      for (int k = 0; k < 3; ++k) joint(JointKind::revolute, Vector3d::Unit(k), 3.0 - 2.0 * k);
      break;
    case LoopKind::hinge: joint(JointKind::revolute, axis, 3.0); break;
    case LoopKind::slider: joint(JointKind::prismatic, axis, 0.5); break;
    case LoopKind::weld: break;
  }
  const Pose in_body = on_body.inverse();
  add(both.tree, "body", body, JointKind::fixed, parent, origin * in_body, Vector3d::UnitX(), 0.0);

  const Mechanism tree(both.tree);
  const State start = tree.initial_state();
  const int index = both.tree.link_index("body");
  Root root{.link = "body", .floating = true};
  root.pose = Pose(tree.link_poses(start)[index]);
  const Eigen::Matrix3d axes = root.pose.linear().transpose();
  const Vector6d velocity = tree.link_velocity(start, index);
  root.velocity << axes * velocity.head<3>(), axes * velocity.tail<3>();
  both.loop.links.push_back({"body", body});
  both.loop.roots.push_back(root);
  Loop& loop = body_first ? add_loop(both.loop, kind, "body", Vector3d::Zero(), "wheel", Vector3d::Zero())
                          : add_loop(both.loop, kind, "wheel", Vector3d::Zero(), "body", Vector3d::Zero());
  loop.axis = 2.5 * axis;
  (body_first ? loop.first_pose : loop.second_pose) = on_body;
  (body_first ? loop.second_pose : loop.first_pose) = on_wheel;
  return both;
}

std::vector<Model> all_models() {
  std::vector<Model> models = {four_bar(),
                               four_bar({.kind = LoopKind::hinge}),
                               parallelogram(),
                               slider_crank(),
                               slider_crank(LoopKind::hinge),
                               slider_crank(LoopKind::slider),
                               five_bar(),
                               stewart(),
                               bar_on_arms(),
                               gripper()};
  for (const LoopKind kind : all_loop_kinds)
    for (const bool body_first : {false, true}) models.push_back(carried(kind, body_first).loop);
  return models;
}

TEST(Loops, models_start_closed_with_velocities_that_fit) {
  for (const Model& model : all_models()) {
    const Mechanism mechanism(model);
    const State start = mechanism.initial_state();
    const LoopRows rows = loop_rows(mechanism, start);
    EXPECT_LT(physics::size(rows.error), 1e-15) << model.name;
    EXPECT_LT(physics::size(rows.jacobian * start.v), 1e-14) << model.name;
  }
}

TEST(Loops, rows_of_origins_are_right_by_hand) {
  // The second frame is 3 m along y of the world from the first, whose x is the world's y.
  Model model = on_ground("hand");
  model.links.push_back({"body", Inertia::box(1.0, {1, 1, 1}, Vector3d::Zero())});
  model.roots.push_back({.link = "body", .floating = true, .pose = at(Vector3d(1.0, 5.0, 0.0))});
  Loop& loop = add_loop(model, LoopKind::weld, "", {1.0, 2.0, 0.0}, "body", Vector3d::Zero());
  loop.first_pose.rotate(Eigen::AngleAxisd(std::numbers::pi / 2.0, Vector3d::UnitZ()));
  const Mechanism mechanism(model);
  const VectorXd error = loop_rows(mechanism, mechanism.initial_state()).error;
  ASSERT_EQ(error.size(), 6);
  EXPECT_LT((error.head<3>() - Vector3d(3.0, 0.0, 0.0)).norm(), 1e-15);
  // From first to second by -90 degrees about z.
  EXPECT_LT((error.tail<3>() - Vector3d(0.0, 0.0, -2.0 * std::sin(std::numbers::pi / 4.0))).norm(), 1e-15);
}

TEST(Loops, a_hinge_misses_by_the_angle_between_the_axes) {
  for (const double angle : {0.001, 0.5}) {
    Model model = on_ground("hinge");
    model.links.push_back({"body", Inertia::box(1.0, {1, 1, 1}, Vector3d::Zero())});
    Root root{.link = "body", .floating = true};
    // A turn about the axis, which the hinge allows, and one across it.
    root.pose.rotate(Eigen::AngleAxisd(angle, Vector3d::UnitX()) * Eigen::AngleAxisd(1.0, Vector3d::UnitZ()));
    model.roots.push_back(root);
    add_loop(model, LoopKind::hinge, "ground", Vector3d::Zero(), "body", Vector3d::Zero()).axis = Vector3d::UnitZ();
    const Mechanism mechanism(model);
    const VectorXd error = loop_rows(mechanism, mechanism.initial_state()).error;
    ASSERT_EQ(error.size(), 5);
    EXPECT_LT((error.tail<2>() - Eigen::Vector2d(2.0 * std::sin(angle / 2.0), 0.0)).norm(), 1e-14);
  }
}

// Rows of origins everywhere, rows of directions where the loops are closed.
TEST(Loops, jacobian_is_the_derivative_of_the_error) {
  std::mt19937 random(1);
  constexpr double step = 1e-5;
  for (const Model& model : all_models()) {
    const Mechanism mechanism(model);
    for (const bool close : {false, true}) {
      State state = scattered(mechanism, random, close ? 0.02 : 0.3);
      if (close) state = closed(mechanism, state);
      const LoopRows rows = loop_rows(mechanism, state);
      const VectorXd rate = (loop_rows(mechanism, mechanism.advanced(state, state.v, step)).error -
                             loop_rows(mechanism, mechanism.advanced(state, state.v, -step)).error) /
                            (2.0 * step);
      const VectorXd predicted = rows.jacobian * state.v;
      for (Eigen::Index i = 0; i < rate.size(); ++i) {
        if (rows.turns[i] && !close) continue;
        EXPECT_NEAR(predicted[i], rate[i], 1e-7) << model.name << ", row " << i;
      }
    }
  }
}

TEST(Loops, bias_is_the_derivative_of_the_jacobian_along_the_velocity) {
  std::mt19937 random(2);
  constexpr double step = 1e-5;
  for (const Model& model : all_models()) {
    const Mechanism mechanism(model);
    const State state = scattered(mechanism, random, 0.3);
    const VectorXd change = (loop_rows(mechanism, mechanism.advanced(state, state.v, step)).jacobian -
                             loop_rows(mechanism, mechanism.advanced(state, state.v, -step)).jacobian) *
                            state.v / (2.0 * step);
    EXPECT_LT(distance(loop_rows(mechanism, state).bias, change), 1e-6) << model.name;
  }
}

// To first order in the error, the closest pose lies across all motions that the loops and couplings allow.
TEST(Loops, closing_takes_the_shortest_way) {
  std::mt19937 random(3);
  constexpr double moved = 1e-5;
  for (const Model& model : all_models()) {
    const Mechanism mechanism(model);
    State open = scattered(mechanism, random, moved);
    const State shut = closed(mechanism, open);
    const LoopRows rows = loop_rows(mechanism, shut);
    EXPECT_LT(physics::size(rows.error), 1e-14) << model.name;
    if (mechanism.root_velocities() > 0) continue;  // the way is the difference of the joints' positions
    const VectorXd way = shut.q - open.q;
    MatrixXd jacobian(rows.error.size() + static_cast<Eigen::Index>(model.couplings.size()), way.size());
    jacobian << rows.jacobian, Couplings(mechanism).jacobian;
    const Eigen::JacobiSVD<MatrixXd> svd(jacobian, Eigen::ComputeFullV);
    const Eigen::Index rank = (svd.singularValues().array() > 1e-9).count();
    EXPECT_LT(physics::size(svd.matrixV().rightCols(way.size() - rank).transpose() * way), 1e-3 * way.norm())
        << model.name;
  }
}

// The four-bar has one degree of freedom, so its energy gives the crank's speed at each angle, and a quadrature, which
// is exact for periodic functions, the time of a turn.
TEST(Loops, exact_motion_takes_the_time_of_a_turn_that_the_energy_gives) {
  const Mechanism mechanism(four_bar());
  const State start = mechanism.initial_state();
  const double total = energy(mechanism, start);
  constexpr int angles = 512;
  double period = 0.0;
  for (int i = 0; i < angles; ++i) {
    const Mechanism there(four_bar({.start = {2.0 * std::numbers::pi * i / angles, 1.0}}));
    const State state = there.initial_state();
    const double speed = std::sqrt((total - there.potential_energy(state)) / there.kinetic_energy(state));
    period += 2.0 * std::numbers::pi / angles / speed;
  }
  const Motion motion = integrate(mechanism, start, held, period, 1, 1500);
  EXPECT_NEAR(motion.end.q[0], start.q[0] + 2.0 * std::numbers::pi, 1e-8);
  EXPECT_NEAR(motion.end.v[0], start.v[0], 1e-7);
  EXPECT_NEAR(energy(mechanism, motion.end), total, 1e-9 * total);
  EXPECT_LT(physics::size(loop_rows(mechanism, motion.end).error), 1e-14);
}

// A joint and the loop that does the same, with both of their bodies in motion.
class Kinds : public testing::TestWithParam<LoopKind> {};

TEST_P(Kinds, exact_motion_is_that_of_a_tree) {
  for (const bool body_first : {false, true}) {
    const Carried both = carried(GetParam(), body_first);
    const Mechanism loop(both.loop), tree(both.tree);
    const State ours = integrate(loop, loop.initial_state(), held, 0.25, 1, 400).end;
    const State theirs = integrate(tree, tree.initial_state(), held, 0.25, 1, 400).end;
    const Eigen::Isometry3d body = loop.link_poses(ours)[both.loop.link_index("body")],
                            same = tree.link_poses(theirs)[both.tree.link_index("body")];
    EXPECT_LT(distance(body.matrix(), same.matrix()), 1e-8);
    EXPECT_NEAR(ours.q[0], theirs.q[0], 1e-8);
    EXPECT_NEAR(energy(loop, ours), energy(tree, theirs), 1e-7);
  }
}

std::string kind_name(const testing::TestParamInfo<LoopKind>& info) {
  switch (info.param) {
    case LoopKind::point: return "point";
    case LoopKind::hinge: return "hinge";
    case LoopKind::slider: return "slider";
    default: return "weld";
  }
}
INSTANTIATE_TEST_SUITE_P(loops, Kinds, testing::ValuesIn(all_loop_kinds), kind_name);

// Poses and velocities as one vector.
VectorXd numbers(const State& state) {
  VectorXd result(7 * static_cast<Eigen::Index>(state.roots.size()) + state.q.size() + state.v.size());
  Eigen::Index row = 0;
  for (const RootPose& root : state.roots) {
    result.segment<7>(row) << root.position, root.orientation.coeffs();
    row += 7;
  }
  result.tail(state.q.size() + state.v.size()) << state.q, state.v;
  return result;
}

// log2 of the factor by which half the step reduces the error of positions and velocities.
double order(const Mechanism& mechanism, const State& truth, double duration, Integrator integrator, int steps) {
  const auto error = [&](int count) {
    State state = mechanism.initial_state();
    for (int n = 0; n < count; ++n) state = after_step(mechanism, settings(duration / count, integrator), state);
    return (numbers(state) - numbers(truth)).norm();
  };
  return std::log2(error(steps) / error(2 * steps));
}

TEST(Loops, steps_are_of_first_and_second_order) {
  constexpr double duration = 0.25;
  const struct {
    Model model;
    int steps;  // of the larger ones; short against the springs' periods
  } cases[] = {
      {four_bar(), 240}, {slider_crank(LoopKind::slider), 240},      {stewart(), 480},
      {gripper(), 1920}, {carried(LoopKind::point, true).loop, 240}, {carried(LoopKind::slider, false).loop, 240}};
  for (const auto& [model, steps] : cases) {
    const Mechanism mechanism(model);
    const State truth = integrate(mechanism, mechanism.initial_state(), held, duration, 1, 1500).end;
    EXPECT_NEAR(order(mechanism, truth, duration, Integrator::euler, steps), 1.0, 0.14) << model.name;
    EXPECT_NEAR(order(mechanism, truth, duration, Integrator::leapfrog, steps), 2.0, 0.14) << model.name;
  }
}

// What a loop holds twice it holds half with each, and rows that no motion needs change nothing.
TEST(Loops, rows_that_depend_on_each_other_are_as_one) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Mechanism once(four_bar()), twice(four_bar({.loops = 2})), hinge(four_bar({.kind = LoopKind::hinge}));
    State one = once.initial_state(), two = one, other = one;
    for (int n = 0; n < 240; ++n) {
      one = after_step(once, settings(1.0 / 240, integrator), one);
      two = after_step(twice, settings(1.0 / 240, integrator), two);
      other = after_step(hinge, settings(1.0 / 240, integrator), other);
    }
    EXPECT_LT(distance(one.q, two.q), 1e-10);
    EXPECT_LT(distance(one.q, other.q), 1e-10);
  }
  const Mechanism once(four_bar()), twice(four_bar({.loops = 2}));
  const Step one = step(once, settings(1.0 / 240), once.initial_state(), once.initial_inputs());
  const Step two = step(twice, settings(1.0 / 240), twice.initial_state(), twice.initial_inputs());
  EXPECT_LT(distance(two.loop_impulses.head(3), 0.5 * one.loop_impulses), 1e-12);
  EXPECT_LT(distance(two.loop_impulses.tail(3), 0.5 * one.loop_impulses), 1e-12);
  EXPECT_GT(physics::size(one.loop_impulses), 1e-3);
}

// Momentum: what the loops' impulses and the free motion add up to.
TEST(Loops, impulses_explain_the_velocity) {
  for (const Model& model : {stewart(), gripper(), bar_on_arms()}) {
    const Mechanism mechanism(model);
    StepSettings one_phase = settings(1.0 / 240);
    one_phase.velocity_iterations = 0;
    const Step found = step(mechanism, one_phase, mechanism.initial_state(), mechanism.initial_inputs());
    State before = found.stage.state;
    before.v = found.state.v;
    mechanism.turn_axes(found.state, before);
    const VectorXd impulse = found.stage.implicit * (before.v - found.stage.free);
    const LoopRows rows = loop_rows(mechanism, found.stage.state);
    EXPECT_LT(distance(impulse, rows.jacobian.transpose() * found.loop_impulses +
                                    found.stage.jacobian.transpose() * found.impulses),
              1e-12)
        << model.name;
  }
}

struct Drift {
  double most_open = 0.0, most_energy = 0.0, energy = 0.0;  // of the start's kinetic energy
};
Drift drift(const Model& model, Integrator integrator, double duration, int chords = 1) {
  const Mechanism mechanism(model);
  State state = mechanism.initial_state();
  const double start = energy(mechanism, state), scale = mechanism.kinetic_energy(state);
  Drift drift;
  for (int n = 0; n < static_cast<int>(240 * duration); ++n) {
    state = after_step(mechanism, settings(1.0 / 240, integrator), state, chords);
    drift.most_open = std::max(drift.most_open, physics::size(loop_rows(mechanism, state).error));
    drift.energy = (energy(mechanism, state) - start) / scale;
    drift.most_energy = std::max(drift.most_energy, drift.energy);
  }
  return drift;
}

TEST(Loops, a_four_bar_stays_closed_and_gains_no_energy_for_a_minute) {
  const Drift euler = drift(four_bar(), Integrator::euler, 60.0);
  EXPECT_LT(euler.most_open, 6e-5);
  EXPECT_LT(euler.most_energy, 0.03);
  const Drift leapfrog = drift(four_bar(), Integrator::leapfrog, 60.0);
  EXPECT_LT(leapfrog.most_open, 3e-7);
  EXPECT_LT(leapfrog.most_energy, 0.03);
  EXPECT_LT(drift(four_bar(), Integrator::leapfrog, 60.0, 2).most_open, 1e-8);
}

// Both cranks of a parallelogram and of a five-bar come to poses in which rows depend on each other.
TEST(Loops, singular_poses_are_passed) {
  EXPECT_LT(drift(parallelogram(), Integrator::euler, 5.0).most_open, 2e-3);
  EXPECT_LT(drift(five_bar(), Integrator::euler, 60.0).most_open, 2e-3);
}

// At rest no motion that the welds allow changes the energy of weight and servos.
TEST(Loops, a_bar_on_two_arms_comes_to_rest_in_balance) {
  const Mechanism mechanism(bar_on_arms());
  State state = mechanism.initial_state();
  for (int n = 0; n < 240 * 30; ++n) state = after_step(mechanism, settings(1.0 / 240), state);
  EXPECT_LT(physics::size(state.v), 1e-10);
  const LoopRows rows = loop_rows(mechanism, state);
  EXPECT_LT(physics::size(rows.error), 1e-10);
  const VectorXd forces = mechanism.joint_forces(state, mechanism.initial_inputs()) - mechanism.bias(state);
  const Eigen::JacobiSVD<MatrixXd> svd(rows.jacobian, Eigen::ComputeFullV);
  EXPECT_LT(physics::size(svd.matrixV().rightCols(3).transpose() * forces), 1e-8);
  EXPECT_GT(physics::size(forces), 1.0);
}

TEST(Loops, a_coupling_holds_beside_loops) {
  const Mechanism mechanism(gripper());
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    State state = mechanism.initial_state();
    for (int n = 0; n < 480; ++n) {
      state = after_step(mechanism, settings(1.0 / 240, integrator), state);
      ASSERT_NEAR(state.q[4], state.q[0], 1e-12);
      ASSERT_LT(physics::size(loop_rows(mechanism, state).error), 1e-4);
    }
    EXPECT_GT(state.q[0], 0.7);  // from 0.6 towards 0.9
  }
}

// Bounds, and loops that yield or slip, make a step a convex minimum.
TEST(Loops, a_range_that_is_out_of_reach_changes_nothing) {
  Model model = gripper();
  const Mechanism free(model);
  model.joints[2].lower = -10.0;
  const Mechanism bounded(model);
  State one = free.initial_state(), other = one;
  for (int n = 0; n < 60; ++n) {
    one = after_step(free, settings(1.0 / 240), one);
    other = after_step(bounded, settings(1.0 / 240), other);
  }
  EXPECT_LT(distance(one.q, other.q), 1e-9);
  EXPECT_LT(distance(one.v, other.v), 1e-7);
}

TEST(Loops, a_crank_presses_the_rocker_on_its_end) {
  Model model = four_bar({.start = {0.5, 0.0}});
  model.joints[0].drive = {.kp = 20.0, .kd = 2.0, .position_target = 2.0};
  const double end = model.joints[2].upper = model.joints[2].position + 0.15;
  const Mechanism mechanism(model);
  State state = mechanism.initial_state();
  for (int n = 0; n < 480; ++n) state = after_step(mechanism, settings(1.0 / 240), state);
  EXPECT_NEAR(state.q[2], end, 1e-9);
  EXPECT_LT(physics::size(state.v), 1e-9);
  EXPECT_LT(physics::size(loop_rows(mechanism, state).error), 1e-9);
  EXPECT_GT(20.0 * (2.0 - state.q[0]), 1.0);  // the servo still pulls
}

// A weight on a slide that a loop holds to the world.
Model weight(const Softness& softness, double force_limit = infinity) {
  Model model = on_ground("weight");
  add(model, "weight", Inertia::box(2.0, {0.1, 0.1, 0.1}, Vector3d::Zero()), JointKind::prismatic, "ground",
      Pose::Identity(), Vector3d::UnitZ(), 0.0);
  Loop& loop = add_loop(model, LoopKind::point, "", Vector3d::Zero(), "weight", Vector3d::Zero());
  loop.softness = softness, loop.force_limit = force_limit;
  return model;
}

TEST(Loops, a_soft_one_sinks_as_a_spring) {
  const Mechanism mechanism(weight(Spring{500.0, 40.0}));
  State state = mechanism.initial_state();
  for (int n = 0; n < 960; ++n) state = after_step(mechanism, settings(1.0 / 240), state);
  EXPECT_NEAR(state.q[0], -2.0 * 9.81 / 500.0, 1e-12);
}

TEST(Loops, a_limit_takes_its_force_off_the_weight) {
  const Mechanism mechanism(weight(Hard{1.0}, 15.0)), strong(weight(Hard{1.0}, 25.0));
  State state = mechanism.initial_state(), rest = state;
  for (int n = 0; n < 24; ++n) {
    state = after_step(mechanism, settings(1.0 / 240), state);
    rest = after_step(strong, settings(1.0 / 240), rest);
  }
  EXPECT_NEAR(state.v[0], -0.1 * (9.81 - 15.0 / 2.0), 1e-12);
  EXPECT_NEAR(rest.q[0], 0.0, 1e-15);
}

TEST(Loops, an_open_one_closes_no_faster_than_three_metres_per_second) {
  Model model = weight(Hard{1.0});
  model.joints[0].position = 0.1;
  const Mechanism mechanism(model);
  StepSettings one_phase = settings(1.0 / 240);
  one_phase.velocity_iterations = 0;
  EXPECT_NEAR(after_step(mechanism, one_phase, mechanism.initial_state()).v[0], -3.0, 1e-12);
}

TEST(Loops, sweeps_and_other_integrators_are_refused) {
  const Mechanism mechanism(four_bar());
  StepSettings swept = settings(1.0 / 240);
  swept.method = Method::pgs;
  EXPECT_THROW(step(mechanism, swept, mechanism.initial_state(), mechanism.initial_inputs()), SettingsError);
  EXPECT_THROW(after_step(mechanism, settings(1.0 / 240, Integrator::runge_kutta), mechanism.initial_state()),
               SettingsError);
}

}  // namespace
}  // namespace lockstep::reference
