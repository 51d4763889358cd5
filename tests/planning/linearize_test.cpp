// Derivatives of a step against those on paper. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "contact_scenes.h"
#include "lockstep/lockstep.h"

namespace lockstep {
namespace {

using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;

constexpr double mass = 0.7, length = 0.4, gravity = 9.81, dt = 1e-2;

// A point mass on a rod, turning about y. Semi-implicit Euler: v' = v + h (u - d v' - m g l sin q) / I, q' = q + h v'.
Model pendulum(double damping = 0.3) {
  Model model;
  model.links.push_back({"base", {}});
  Link bob{"bob", {}};
  bob.inertia.mass = mass, bob.inertia.center = {0, 0, -length};
  model.links.push_back(bob);
  Joint joint;
  joint.name = "swing", joint.kind = JointKind::continuous, joint.parent = "base", joint.child = "bob";
  joint.axis = {0, 1, 0}, joint.damping = damping, joint.armature = 0.05, joint.position = 0.8, joint.velocity = 0.4;
  model.joints.push_back(joint);
  return model;
}

StepSettings euler(ParameterSet fields = {}) {
  StepSettings settings;
  settings.dt = dt, settings.integrator = Integrator::euler, settings.per_environment = fields;
  return settings;
}

double inertia() { return mass * length * length + 0.05; }

TEST(Linearize, agrees_with_a_pendulum_on_paper) {
  const double d = 0.3;
  const Plan plan = compile(pendulum(d), euler({Parameter::damping}));
  Batch<double> batch(plan, 3, {.threads = 1});
  for (int e = 0; e < 3; ++e) batch.positions()(0, e) = 0.8 + 7.0 * e;  // also beyond whole turns
  const std::vector<std::byte> before = batch.save();
  const auto all = batch.linearize(EnvironmentSet::all(), {.inputs = ActionKind::effort,
                                                           .parameters = {{Parameter::damping, 0}},
                                                           .record = {{Quantity::velocity, {}, 2.0}}});
  EXPECT_EQ(batch.save(), before);
  ASSERT_EQ(all.size(), 3u);
  for (int e = 0; e < 3; ++e) {
    const double q = 0.8 + 7.0 * e, v = 0.4, denominator = inertia() + dt * d;
    const double by_q = -dt * mass * gravity * length * std::cos(q) / denominator, by_v = inertia() / denominator;
    const double next = (inertia() * v - dt * mass * gravity * length * std::sin(q)) / denominator;
    Matrix2d a;
    a << 1 + dt * by_q, dt * by_v, by_q, by_v;
    const Vector2d b(dt * dt / denominator, dt / denominator),
        p(-dt * dt * next / denominator, -dt * next / denominator);
    const Linearization& own = all[static_cast<std::size_t>(e)];
    EXPECT_EQ(own.fault, Fault::none);
    EXPECT_LT((own.state_by_state - a).cwiseAbs().maxCoeff(), 1e-7) << own.state_by_state;
    EXPECT_LT((own.state_by_input - b).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((own.state_by_parameter - p).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((own.record_by_state - 2.0 * a.row(1)).cwiseAbs().maxCoeff(), 1e-7);
    EXPECT_LT((own.record_by_input - 2.0 * b.tail(1)).cwiseAbs().maxCoeff(), 1e-7);
  }
}

// A second rotor geared to the pendulum adds G^2 J; its own ratio in each environment.
TEST(Linearize, agrees_with_a_geared_pair_on_paper) {
  Model model = pendulum(0.0);
  model.links.push_back({"rotor", Inertia::box(0.3, {0.1, 0.1, 0.1}, {0, 0, 0})});
  Joint joint;
  joint.name = "rotor", joint.kind = JointKind::continuous, joint.parent = "base", joint.child = "rotor";
  joint.axis = {0, 1, 0};
  model.joints.push_back(joint);
  model.couplings.push_back(Coupling::mimic("rotor", "swing", -2.5));
  const Plan plan = compile(model, euler({Parameter::gear_ratio}));
  EXPECT_EQ(coordinate_dofs(plan), std::vector<int>{0});
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.parameter(Parameter::gear_ratio)(0, 1) = -4.0;
  batch.project();
  const auto all = batch.linearize(EnvironmentSet::all(),
                                   {.inputs = ActionKind::effort, .parameters = {{Parameter::gear_ratio, 0}}});
  for (int e = 0; e < 2; ++e) {
    const double ratio = e == 0 ? 2.5 : 4.0, rotor = 0.3 * 0.02 / 12.0, total = inertia() + ratio * ratio * rotor;
    const double by_q = -dt * mass * gravity * length * std::cos(0.8) / total;
    Matrix2d a;
    a << 1 + dt * by_q, dt, by_q, 1;
    const double by_ratio = -dt * mass * gravity * length * std::sin(0.8) / total * (2.0 * ratio * rotor / total);
    const Linearization& own = all[static_cast<std::size_t>(e)];
    EXPECT_LT((own.state_by_state - a).cwiseAbs().maxCoeff(), 1e-7) << own.state_by_state;
    EXPECT_NEAR(own.state_by_input(1, 0), dt / total, 1e-7);
    EXPECT_NEAR(own.state_by_parameter(1, 0), by_ratio, 1e-7);
  }
}

// A free body in the air, in the axes of its root: dp' = R'^T R (dp + ...). Against the chain of two steps.
TEST(Linearize, of_two_steps_is_the_product_of_each) {
  Model model;
  contact_scenes::add_block(model, "body", 1.3, {0.1, 0.2, 0.3}, {0, 0, 1}, 0.5);
  model.roots[0].velocity << 0.3, -0.8, 0.5, 0.2, 0.1, -0.4;
  const Plan plan = compile(model, euler());
  Batch<double> batch(plan, 1, {.threads = 1});
  const MatrixXd both = batch.linearize(EnvironmentSet::all(), {.substeps = 2})[0].state_by_state;
  const MatrixXd first = batch.linearize()[0].state_by_state;
  batch.step();
  const MatrixXd second = batch.linearize()[0].state_by_state;
  ASSERT_EQ(both.rows(), 12);
  EXPECT_LT((both - second * first).cwiseAbs().maxCoeff(), 1e-7);
  EXPECT_LT((first.block<3, 3>(0, 6) - dt * MatrixXd::Identity(3, 3)).cwiseAbs().maxCoeff(), 1e-3);
}

StepSettings exact_contacts() {
  StepSettings settings = euler();
  settings.dt = 1.0 / 240.0, settings.contacts = {10, 200, 1e-12};
  return settings;
}

// A block that is pushed down by its weight. Sliding, friction does not depend on the speed; sticking, it takes all.
TEST(Linearize, agrees_with_a_block_that_slides_and_sticks) {
  for (const bool slides : {true, false}) {
    SCOPED_TRACE(slides);
    Model model = contact_scenes::block(0.5);
    model.gravity = {slides ? 8.0 : 2.0, 0.0, -9.81};
    if (slides) model.roots[0].velocity[3] = 0.5;
    const Plan plan = compile(model, exact_contacts());
    Batch<double> batch(plan, 1, {.threads = 1});
    batch.step(60);
    const Linearization own = batch.linearize()[0];
    ASSERT_EQ(own.fault, Fault::none);
    // Columns 6 ... 11 are the twist: x is 9.
    // Contacts yield by 1e-3 of the response, so what sticks keeps 2e-3 of a change.
    EXPECT_NEAR(own.state_by_state(9, 9), slides ? 1.0 : 2e-3, 1e-5);
    EXPECT_NEAR(own.state_by_state(3, 9), slides ? plan.settings().dt : 0.0, 2e-5);
    EXPECT_NEAR(own.state_by_state(3, 3), 1.0, 1e-6);
  }
}

TEST(Linearize, has_the_same_bits_for_any_number_of_threads) {
  Model model = contact_scenes::block(0.5);
  const Plan plan = compile(model, exact_contacts());
  std::vector<MatrixXd> results;
  for (const int threads : {1, 2}) {
    Batch<double> batch(plan, 40, {.threads = threads});
    batch.step(20);
    results.push_back(batch.linearize()[33].state_by_state);
  }
  EXPECT_TRUE((results[0].array() == results[1].array()).all());
}

TEST(Linearize, refuses_what_it_cannot_do) {
  const Plan plan = compile(pendulum(), euler());
  Batch<double> batch(plan, 1, {.threads = 1});
  EXPECT_THROW(Batch<float>(plan, 1).linearize(), UsageError);
  EXPECT_THROW(batch.linearize(EnvironmentSet::all(), {.substeps = 0}), UsageError);
  EXPECT_THROW(batch.linearize(EnvironmentSet::all(), {.inputs = ActionKind::position_change}), UsageError);
  EXPECT_THROW(batch.linearize(EnvironmentSet::all(), {.parameters = {{Parameter::mass, 0}}}), UsageError);
  EXPECT_THROW(batch.linearize(EnvironmentSet::all(), {.step = 0.0}), UsageError);
  EXPECT_THROW(Batch<double>(compile(contact_scenes::block()), 1).linearize(), UsageError);
}

// What has no range below it is moved upwards alone.
TEST(Linearize, by_parameters_at_an_end_of_their_range_is_one_sided) {
  const Plan plan = compile(pendulum(0.0), euler({Parameter::damping, Parameter::friction, Parameter::armature}));
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.positions().row(0) << 0.8, 0.3;
  const auto all =
      batch.linearize(EnvironmentSet::all(),
                      {.parameters = {{Parameter::damping, 0}, {Parameter::friction, 0}, {Parameter::armature, 0}}});
  for (int e = 0; e < 2; ++e) {
    const Linearization& own = all[static_cast<std::size_t>(e)];
    const double q = batch.positions()(0, e), v = 0.4;
    const double gained = -dt * mass * gravity * length * std::sin(q) / inertia(), next = v + gained;
    EXPECT_EQ(own.fault, Fault::none);
    EXPECT_NEAR(own.state_by_parameter(1, 0), -dt * next / inertia(), 1e-6) << e;
    EXPECT_NEAR(own.state_by_parameter(1, 1), -dt / inertia(), 1e-6) << e;
    EXPECT_NEAR(own.state_by_parameter(1, 2), -gained / inertia(), 1e-6) << e;
  }
}

TEST(Linearize, refuses_what_has_no_difference) {
  Model model = pendulum();
  model.joints[0].kind = JointKind::revolute, model.joints[0].lower = -1.0;
  const Plan plan = compile(model, [] {
    StepSettings settings = euler({Parameter::position_limits, Parameter::velocity_limit});
    settings.contacts.tolerance = 1e-10;
    return settings;
  }());
  Batch<double> batch(plan, 1, {.threads = 1});
  const auto by = [&](ParameterRow row) { return batch.linearize(EnvironmentSet::all(), {.parameters = {row}}); };
  EXPECT_EQ(by({Parameter::position_limits, 0})[0].fault, Fault::none);
  EXPECT_THROW(by({Parameter::position_limits, 1}), UsageError);
  EXPECT_THROW(by({Parameter::velocity_limit, 0}), UsageError);
}

TEST(Linearize, flags_a_bad_environment_and_no_other) {
  const Plan plan = compile(pendulum(), euler({Parameter::mass}));
  Batch<double> batch(plan, 2, {.threads = 1});
  batch.parameter(Parameter::mass)(1, 0) = -1.0;
  const auto all = batch.linearize();
  EXPECT_EQ(all[0].fault, Fault::bad_value);
  EXPECT_TRUE(all[0].state_by_state.array().isNaN().all());
  EXPECT_EQ(all[1].fault, Fault::none);
  EXPECT_TRUE(all[1].state_by_state.allFinite());
}

Model held_arm(const Softness& softness, double force_limit) {
  Model model = pendulum();
  model.joints[0].position = 0.0;
  Loop& loop = model.loops.emplace_back();
  loop.name = "pin", loop.kind = LoopKind::point, loop.first = "", loop.second = model.joints[0].child;
  loop.softness = softness, loop.force_limit = force_limit;
  loop.second_pose.translation() = Eigen::Vector3d(0.0, 0.0, -length);
  loop.first_pose.translation() = Eigen::Vector3d(0.0, 0.0, -length);
  return model;
}

// What is soft, or has slipped, leaves coordinates of its own.
TEST(Linearize, refuses_loops_and_couplings_that_do_not_hold) {
  const auto words = [](const Batch<double>& batch) -> std::string {
    try {
      batch.linearize();
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  };
  StepSettings settings = euler();
  settings.contacts.tolerance = 1e-10;
  EXPECT_NE(words(Batch<double>(compile(held_arm(Spring{20.0, 1.0}, infinity), settings), 1)).find("is soft"),
            std::string::npos);
  Batch<double> slips(compile(held_arm(Hard{}, 5.0), settings), 2, {.threads = 1});
  slips.positions()(0, 1) = 0.1;
  EXPECT_NE(words(slips).find("environment 1: has the loop 'pin' slipped"), std::string::npos) << words(slips);

  Model model = pendulum();
  model.links.push_back(model.links.back());
  model.links.back().name = "second";
  model.joints.push_back(model.joints.back());
  model.joints.back().name = "follower", model.joints.back().child = "second";
  model.couplings = {Coupling::mimic("follower", model.joints[0].name, -1.0)};
  model.couplings[0].force_limit = 2.0;
  Batch<double> pair(compile(model, settings), 3, {.threads = 1});
  EXPECT_EQ(words(pair), "");
  pair.positions()(1, 2) += 0.05;
  EXPECT_NE(words(pair).find("environment 2: has the coupling"), std::string::npos) << words(pair);
}

// The rotation vector of a ball jumps where it has turned by pi; a gap of what is far away is infinite before and
// after.
TEST(Linearize, of_records_takes_turns_and_infinite_gaps_for_what_they_are) {
  Model model;
  model.gravity.setZero();
  model.links = {{"base", {}}, {"arm", Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())}};
  model.add_ball("ball", "base", "arm");
  model.colliders = {{.name = "arm", .link = "arm", .shape = Shape::sphere(0.1)},
                     {.name = "floor", .shape = Shape::half_space(), .pose = Pose(Eigen::Translation3d(0, 0, -5))}};
  model.contacts = {{"floor", "arm"}};
  StepSettings settings = euler();
  settings.contacts.tolerance = 1e-10;
  Batch<double> batch(compile(model, settings), 2, {.threads = 1});
  for (int e = 0; e < 2; ++e) {
    const double angle = e == 0 ? 3.0 : std::numbers::pi - 1e-9;
    batch.positions().col(e) << 0.6 * angle, 0.8 * angle, 0.0;
  }
  const std::vector<Query> queries = {{Quantity::position}, {Quantity::contact_gap}, {Quantity::position, {1}, 2.0}};
  for (const Linearization& own : batch.linearize(EnvironmentSet::all(), {.record = queries})) {
    EXPECT_EQ(own.fault, Fault::none);
    EXPECT_TRUE(own.record_by_state.row(4).isApprox(2.0 * own.record_by_state.row(1)));
    EXPECT_TRUE(own.record_by_state.topRows(3).leftCols(3).isApprox(own.state_by_state.topLeftCorner(3, 3), 1e-6));
    EXPECT_LT(own.record_by_state.cwiseAbs().maxCoeff(), 10.0);
    EXPECT_TRUE((own.record_by_state.row(3).array() == 0.0).all());
  }
}

}  // namespace
}  // namespace lockstep
