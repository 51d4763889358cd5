// Tendons: sums of joint positions with springs, servos and bounds. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "lockstep/error.h"
#include "physics.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using physics::sliders;

constexpr double h = 1.0 / 240;

// q_tendon = sum of c q + constant
Joint& add_tendon(Model& model, const std::string& name, const std::vector<std::pair<std::string, double>>& terms,
                  double constant = 0.0) {
  Joint joint;
  joint.name = name, joint.kind = JointKind::tendon;
  Coupling coupling{name, {}, -constant, Hard{}};
  for (const auto& [other, coefficient] : terms) coupling.terms.push_back({other, -coefficient});
  model.couplings.push_back(coupling);
  return model.joints.emplace_back(joint);
}

Joint& joint_of(Model& model, const std::string& name) {
  return model.joints[static_cast<std::size_t>(model.joint_index(name))];
}

Plan planned(const Model& model, Integrator integrator = Integrator::euler) {
  StepSettings settings;
  settings.dt = h;
  settings.integrator = integrator;
  return compile(model, settings);
}

double position(const Batch<double>& batch, const std::string& joint, int environment = 0) {
  return batch.positions()(batch.plan().dof(joint), environment);
}

// Masses of 1 and 2 kg, and a tendon over both.
Model pair_of_sliders() {
  Model model = sliders({1.0, 2.0});
  joint_of(model, "s0").position = 0.3, joint_of(model, "s1").position = -0.1;
  joint_of(model, "s0").velocity = 0.5, joint_of(model, "s1").velocity = 0.7;
  return model;
}

// Of linear terms, the step is a linear system: (M + h d c c^T + h^2 k c c^T + a c c^T) (v' - v) = h f.
TEST(Tendons, take_their_linear_terms_implicitly) {
  Model model = pair_of_sliders();
  Joint& tendon = add_tendon(model, "t", {{"s0", 1.5}, {"s1", -0.5}}, 0.2);
  tendon.stiffness = 300.0, tendon.rest = 0.1, tendon.damping = 4.0, tendon.armature = 0.3, tendon.effort = 2.0;
  tendon.drive.kp = 200.0, tendon.drive.kd = 5.0, tendon.drive.position_target = 0.4;
  tendon.drive.velocity_target = -0.3;
  const Eigen::Vector2d c(1.5, -0.5), q(0.3, -0.1), v(0.5, 0.7);
  const double length = c.dot(q) + 0.2, rate = c.dot(v);
  const Eigen::Matrix2d a = Eigen::Vector2d(1.0, 2.0).asDiagonal().toDenseMatrix() +
                            (0.3 + h * (4.0 + 5.0) + h * h * (300.0 + 200.0)) * c * c.transpose();
  const double force =
      2.0 - 300.0 * (length + h * rate - 0.1) - 4.0 * rate - 200.0 * (length + h * rate - 0.4) - 5.0 * (rate + 0.3);
  const Eigen::Vector2d next = v + a.ldlt().solve(h * force * c);
  Batch<double> batch(planned(model), 1);
  EXPECT_NEAR(batch.positions()(2, 0), length, 1e-15);
  EXPECT_NEAR(batch.velocities()(2, 0), rate, 1e-15);
  batch.step();
  EXPECT_LT(physics::distance(batch.velocities().matrix().col(0).head(2), next), 1e-13);
  EXPECT_NEAR(batch.velocities()(2, 0), c.dot(next), 1e-13);
  EXPECT_NEAR(batch.positions()(2, 0), c.dot(q + h * next) + 0.2, 1e-13);
}

// A tendon over one joint with the ratio 2 is that joint with other units.
using Feature = std::function<void(Joint& joint, double ratio)>;
struct Case {
  const char* name;
  Feature feature;
};
class OneJoint : public testing::TestWithParam<Case> {};

TEST_P(OneJoint, moves_as_by_its_own_bounds_and_drives) {
  Model alone = physics::sliders({1.5});
  joint_of(alone, "s0").velocity = 1.0;
  Model pulled = alone;
  GetParam().feature(joint_of(alone, "s0"), 1.0);
  GetParam().feature(add_tendon(pulled, "t", {{"s0", 2.0}}), 2.0);
  Batch<double> one(planned(alone), 1), other(planned(pulled), 1);
  double reached = 0.0;
  for (int i = 0; i < 400; ++i) {
    one.step(), other.step();
    ASSERT_NEAR(position(one, "s0"), position(other, "s0"), 1e-10) << i;
    ASSERT_NEAR(position(other, "t"), 2.0 * position(other, "s0"), 1e-12);
    reached = std::max(reached, position(one, "s0"));
  }
  EXPECT_GT(reached, 0.1);
}

INSTANTIATE_TEST_SUITE_P(
    each, OneJoint,
    testing::Values(Case{"range", [](Joint& j, double r) { j.lower = -0.2 * r, j.upper = 0.3 * r; }},
                    Case{"soft_range",
                         [](Joint& j, double r) {
                           j.upper = 0.3 * r, j.limit_softness = Spring{100.0 / (r * r), 3.0 / (r * r)};
                         }},
                    Case{"restitution", [](Joint& j, double r) { j.upper = 0.3 * r, j.restitution = 0.5; }},
                    Case{"speed", [](Joint& j, double r) { j.velocity_limit = 0.4 * r; }},
                    Case{"friction", [](Joint& j, double r) { j.friction = 1.5 / r; }},
                    Case{"limited_servo",
                         [](Joint& j, double r) {
                           j.effort = 1.0 / r, j.drive.kp = 100.0 / (r * r), j.drive.kd = 5.0 / (r * r),
                           j.drive.position_target = 0.7 * r;
                           j.effort_limit = 2.0 / r;
                         }},
                    Case{"kinematic",
                         [](Joint& j, double r) { j.drive.kinematic = true, j.drive.position_target = 0.3 * r; }},
                    Case{"spring", [](Joint& j, double r) { j.stiffness = 40.0 / (r * r), j.rest = 0.1 * r; }}),
    [](const auto& info) { return info.param.name; });

// Its force is along the tendon, so it leaves momentum across alone.
TEST(Tendons, end_at_their_range_and_slide_along_it) {
  Model model = sliders({1.0, 2.0});
  joint_of(model, "s0").velocity = 1.0, joint_of(model, "s1").velocity = 0.2;
  Joint& tendon = add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  tendon.upper = 0.25, tendon.lower = -1.0;
  Batch<double> batch(planned(model), 1);
  batch.step(240);
  EXPECT_NEAR(position(batch, "s0") + position(batch, "s1"), 0.25, 1e-12);
  EXPECT_NEAR(batch.velocities()(0, 0) - 2.0 * batch.velocities()(1, 0), 1.0 - 2.0 * 0.2, 1e-12);
  EXPECT_GT(std::abs(batch.velocities()(0, 0)), 0.1);
}

// A spring without force within a range is a soft range.
TEST(Tendons, have_springs_with_a_range_without_force) {
  Model model = sliders({1.0, 1.0});
  joint_of(model, "s0").velocity = 1.0;
  Joint& tendon = add_tendon(model, "t", {{"s0", 1.0}, {"s1", -1.0}});
  tendon.lower = -0.1, tendon.upper = 0.1, tendon.limit_softness = Spring{50.0, 0.0};
  Batch<double> batch(planned(model), 1);
  double longest = 0.0;
  for (int i = 0; i < 480; ++i) {
    const double before = batch.velocities()(0, 0) - batch.velocities()(1, 0), length = batch.positions()(2, 0);
    batch.step();
    const double after = batch.velocities()(0, 0) - batch.velocities()(1, 0), next = batch.positions()(2, 0);
    if (std::abs(length) < 0.1 && std::abs(next) < 0.1) {
      ASSERT_NEAR(after, before, 1e-13);
    } else if (length > 0.1 && next > 0.1) {
      ASSERT_NEAR(after - before, -2.0 * h * 50.0 * (next - 0.1), 1e-12);
    }
    longest = std::max(longest, next);
  }
  EXPECT_GT(longest, 0.15);
  EXPECT_NEAR(batch.velocities()(0, 0) + batch.velocities()(1, 0), 1.0, 1e-12);
}

TEST(Tendons, drive_a_differential) {
  Model model = sliders({1.0, 1.0});
  for (const auto& [name, sign] : {std::pair("sum", 1.0), std::pair("difference", -1.0)}) {
    Joint& tendon = add_tendon(model, name, {{"s0", 1.0}, {"s1", sign}});
    tendon.drive.kp = 100.0, tendon.drive.kd = 20.0, tendon.effort_limit = 5.0;
  }
  const Plan plan = planned(model);
  EXPECT_EQ(plan.driven_dofs(), (std::vector<int>{2, 3}));
  EXPECT_EQ(plan.independent_dofs(), (std::vector<int>{0, 1}));
  Batch<double> batch(plan, 1);
  batch.position_targets()(2, 0) = 0.6, batch.position_targets()(3, 0) = -0.2;
  batch.step(1200);
  EXPECT_NEAR(position(batch, "s0"), 0.2, 1e-9);
  EXPECT_NEAR(position(batch, "s1"), 0.4, 1e-9);
}

// Their actions reach as far as the ranges of their joints.
TEST(Tendons, take_actions) {
  Model model = sliders({1.0, 1.0});
  joint_of(model, "s0").lower = -0.5, joint_of(model, "s0").upper = 1.0;
  joint_of(model, "s1").lower = 0.0, joint_of(model, "s1").upper = 2.0;
  Joint& tendon = add_tendon(model, "t", {{"s0", 2.0}, {"s1", -1.0}}, 0.5);
  tendon.drive.kp = 10.0, tendon.upper = 2.0;
  Batch<double> batch(planned(model), 2);
  const double actions[] = {-1.0, 1.0};
  batch.set_actions({actions, 2, 1}, {});
  EXPECT_NEAR(batch.position_targets()(2, 0), 2.0 * -0.5 - 2.0 + 0.5, 1e-15);
  EXPECT_NEAR(batch.position_targets()(2, 1), 2.0, 1e-15);  // its own end
}

TEST(Tendons, stick_by_friction_and_slip_beyond_it) {
  for (const double effort : {0.9, 1.1}) {
    Model model = sliders({1.0, 1.0});
    joint_of(model, "s0").effort = effort;
    add_tendon(model, "t", {{"s0", 1.0}}).friction = 1.0;
    Batch<double> batch(planned(model), 1);
    batch.step(240);
    EXPECT_NEAR(batch.velocities()(0, 0), effort < 1.0 ? 0.0 : 0.1, 1e-12);
  }
}

// Two springs and a pendulum: no integrator gains or loses energy in the long run.
TEST(Tendons, keep_energy) {
  for (const Integrator integrator : {Integrator::leapfrog, Integrator::runge_kutta}) {
    Model model;
    model.links.push_back({"base", {}});
    physics::append_link(model, "base", {0, 0, 0}, {0, 1, 0}).position = 0.5;
    const std::string first = model.links.back().name;
    physics::append_link(model, first, {0.1, 0, 0}, {0, 1, 0}).position = -0.2;
    Joint& tendon = add_tendon(model, "t", {{model.joints[0].name, 1.0}, {model.joints[1].name, 0.7}});
    tendon.stiffness = 2.0, tendon.armature = 0.01;
    Batch<double> batch(planned(model, integrator), 1);
    const auto energy = [&] {
      const double length = batch.positions()(2, 0);
      return batch.kinetic_energies()(0, 0) + batch.potential_energies()(0, 0) + 0.5 * 2.0 * length * length;
    };
    const double before = energy();
    double most = 0.0, fastest = 0.0;
    for (int i = 0; i < 2400; ++i) {
      batch.step();
      most = std::max(most, std::abs(energy() - before));
      fastest = std::max(fastest, batch.kinetic_energies()(0, 0));
    }
    EXPECT_LT(most, 0.02 * fastest) << to_string(integrator);
    EXPECT_GT(fastest, 0.05);
  }
}

// What a user writes into a tendon's rows is not a state.
TEST(Tendons, are_where_their_joints_are_whatever_is_written) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}}).stiffness = 10.0;
  Batch<double> one(planned(model), 3), other(planned(model), 3);
  other.positions().row(2) = 7.0, other.velocities().row(2) = -3.0;
  EXPECT_EQ(other.coupling_errors()(0, 0), 0.0);
  one.step(4);
  for (int i = 0; i < 4; ++i) other.step();
  EXPECT_TRUE((one.positions() == other.positions()).all());
  EXPECT_TRUE((one.velocities() == other.velocities()).all());
}

TEST(Tendons, are_read_where_their_joints_are) {
  Model model = pair_of_sliders();
  Joint& tendon = add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  tendon.lower = -0.1, tendon.upper = 0.3;
  add_tendon(model, "slack", {{"s0", 1.0}}).upper = 0.0;
  model.joints.back().limit_softness = Spring{1.0, 0.0};
  Batch<double> batch(planned(model), 1);
  batch.positions()(0, 0) = 1.0, batch.velocities().col(0).head(2).setConstant(2.0);
  EXPECT_NEAR(batch.limit_violations()(0, 0), 1.0 - 0.1 - 0.3, 1e-15);
  EXPECT_EQ(batch.speeds()(0, 0), 4.0);
}

// A spring is no bound, though a soft range stands for it.
TEST(Tendons, keep_their_springs_where_position_limits_are_ignored) {
  Model model = pair_of_sliders();
  Joint& tendon = add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  tendon.upper = 0.1, tendon.limit_softness = Spring{50.0, 0.0};
  StepSettings settings;
  settings.integrator = Integrator::euler;
  Batch<double> one(compile(model, settings), 1);
  settings.ignore.position_limits = true;
  Batch<double> other(compile(model, settings), 1);
  one.step(100), other.step(100);
  EXPECT_TRUE((one.positions() == other.positions()).all());
  EXPECT_LT(one.velocities()(0, 0), 0.4);  // the spring has pulled
}

// A coupling of locked joints and of no others is redundant, unless it places a tendon.
TEST(Tendons, over_locked_joints_stand_still) {
  Model model = pair_of_sliders();
  model.couplings = {Coupling::mimic("s0", "s1", -1.0), Coupling::mimic("s0", "s1", 1.0)};
  for (Joint& joint : model.joints) joint.position = joint.velocity = 0.0;
  add_tendon(model, "t", {{"s0", 1e9}});
  Batch<double> batch(planned(model), 1);
  batch.step(10);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(position(batch, "t"), 0.0);
  EXPECT_TRUE(batch.plan().redundant_couplings().empty());
}

TEST(Tendons, have_friction_and_drives_only_where_the_model_has_them) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}}).stiffness = 1.0;
  StepSettings settings;
  settings.per_environment = {Parameter::friction, Parameter::drive_gains};
  const Plan plan = compile(model, settings);
  EXPECT_EQ(plan.integrator(), Integrator::leapfrog);
  EXPECT_EQ(plan.driven_dofs(), (std::vector<int>{0, 1}));
}

TEST(Tendons, of_frozen_environments_stay_as_they_are) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}}).stiffness = 10.0;
  Batch<double> batch(planned(model), 2);
  batch.velocities()(0, 1) = std::numeric_limits<double>::infinity();
  batch.step();
  ASSERT_EQ(batch.faults()[1], Fault::not_finite);
  const MatrixXd before = batch.positions().matrix();
  batch.positions()(2, 1) = 5.0;
  batch.step();
  EXPECT_EQ(batch.positions()(2, 1), 5.0);
  EXPECT_EQ(batch.positions()(0, 1), before(0, 1));
}

TEST(Tendons, count_the_turns_of_their_joints) {
  Model model;
  model.links.push_back({"base", {}});
  model.gravity.setZero();
  for (int i = 0; i < 2; ++i) {
    Joint& joint = physics::append_link(model, "base", {0.0, 0.2 * i, 0.0}, {0, 0, 1});
    joint.kind = JointKind::continuous;
    joint.velocity = i == 0 ? 20.0 : -5.0;
  }
  add_tendon(model, "t", {{model.joints[0].name, 1.0}, {model.joints[1].name, 1.0}});
  Batch<double> batch(planned(model), 1);
  batch.step(480);
  EXPECT_NEAR(position(batch, "t"), 2.0 * 15.0, 1e-9);
}

TEST(Tendons, follow_gear_ratios_and_offsets_of_each_environment) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}}).stiffness = 10.0;
  StepSettings settings;
  settings.dt = h, settings.integrator = Integrator::euler;
  settings.per_environment = {Parameter::gear_ratio, Parameter::offset};
  Batch<double> batch(compile(model, settings), 2);
  batch.parameter(Parameter::gear_ratio)(1, 1) = -3.0;
  batch.parameter(Parameter::offset)(0, 1) = 0.5;
  batch.step(10);
  for (int e = 0; e < 2; ++e)
    EXPECT_NEAR(position(batch, "t", e),
                position(batch, "s0", e) + (e == 0 ? 1.0 : 3.0) * position(batch, "s1", e) - (e == 0 ? 0.0 : 0.5),
                1e-12);
}

void expect_broken(const std::function<void(Model&)>& spoil, const std::string& rule) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  ASSERT_NO_THROW(model.validate());
  spoil(model);
  try {
    model.validate();
    ADD_FAILURE() << "no error: " << rule;
  } catch (const ModelError& error) {
    EXPECT_NE(std::string(error.what()).find(rule), std::string::npos) << error.what();
  }
}

TEST(Tendons, break_rules_that_are_named) {
  expect_broken([](Model& m) { m.joints.back().child = m.links.back().name; }, "has a parent or a child");
  expect_broken([](Model& m) { m.couplings.clear(); }, "follows 0 couplings");
  expect_broken([](Model& m) { m.couplings.push_back(m.couplings.back()); }, "follows 2 couplings");
  expect_broken([](Model& m) { m.couplings.back().softness = Spring{1.0, 0.0}; }, "is soft or has a force limit");
  expect_broken([](Model& m) { m.couplings.back().force_limit = 1.0; }, "is soft or has a force limit");
  expect_broken([](Model& m) { m.couplings.push_back(Coupling::mimic("s0", "t", 1.0)); }, "among its leaders");
  expect_broken(
      [](Model& m) {
        m.joints.back().upper = 1.0, m.joints.back().limit_softness = Frequency{10.0, 1.0};
      },
      "softness by frequency");
}

TEST(Tendons, need_couplings_that_are_eliminated) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  for (const Method method : {Method::pgs, Method::tgs, Method::direct}) {
    StepSettings settings;
    settings.method = method;
    EXPECT_THROW(compile(model, settings), SettingsError) << to_string(method);
  }
}

// Other couplings may be soft or off in an environment; where the tendon is must not depend on it.
TEST(Tendons, stand_beside_softness_and_switches_per_environment) {
  Model model = pair_of_sliders();
  add_tendon(model, "t", {{"s0", 1.0}, {"s1", 1.0}});
  StepSettings settings;
  settings.per_environment = {Parameter::softness, Parameter::coupling_switch};
  Batch<double> batch(compile(model, settings), 3, {.threads = 1});
  batch.efforts().setConstant(1.0);
  batch.step(10);
  for (int e = 0; e < 3; ++e) EXPECT_EQ(batch.faults()[e], Fault::none);
  const int t = batch.plan().dof("t"), s0 = batch.plan().dof("s0"), s1 = batch.plan().dof("s1");
  EXPECT_NEAR(batch.positions()(t, 0), batch.positions()(s0, 0) + batch.positions()(s1, 0), 1e-12);
  batch.parameter(Parameter::coupling_switch)(0, 1) = 0.0;
  batch.parameter(Parameter::softness)(1, 2) = 0.1;
  batch.step(1);
  EXPECT_EQ(batch.faults()[0], Fault::none);
  EXPECT_EQ(batch.faults()[1], Fault::bad_value);
  EXPECT_EQ(batch.faults()[2], Fault::bad_value);
}

}  // namespace
}  // namespace lockstep
