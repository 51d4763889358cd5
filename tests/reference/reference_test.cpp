// Kinematics and dynamics of the reference agree with theory. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "reference/couplings.h"
#include "reference/step.h"
#include "reference/truth.h"
#include "scenes/scenes.h"

namespace lockstep::reference {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

double difference(const MatrixXd& a, const MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff(); }

Matrix3d cross(const Vector3d& a) {
  Matrix3d m;
  m << 0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0;
  return m;
}

Joint revolute(const std::string& name, const std::string& parent, const std::string& child, const Vector3d& origin,
               const Vector3d& axis) {
  Joint joint;
  joint.name = name, joint.kind = JointKind::revolute, joint.parent = parent, joint.child = child, joint.axis = axis;
  joint.origin.translation() = origin;
  return joint;
}

// An arm of two links with lengths 0.5 and 0.4 and centres of mass at 0.2 and 0.3. Joints turn about z; gravity points
// along -y.
Model planar_arm() {
  Model model;
  model.gravity = {0, -9.81, 0};
  model.links = {{"base", {}},
                 {"upper", {2.0, {0.2, 0, 0}, Vector3d(0.01, 0.05, 0.05).asDiagonal()}},
                 {"lower", {1.0, {0.3, 0, 0}, Vector3d(0.01, 0.03, 0.03).asDiagonal()}}};
  model.joints = {revolute("shoulder", "base", "upper", {0, 0, 0}, Vector3d::UnitZ()),
                  revolute("elbow", "upper", "lower", {0.5, 0, 0}, Vector3d::UnitZ())};
  return model;
}

// Models without joint forces and couplings, which keep energy and momentum.
scenes::RandomOptions conservative(scenes::RandomOptions::Root root) {
  scenes::RandomOptions options;
  options.root = root;
  options.max_dofs = 10;
  options.damping = options.drives = options.efforts = options.couplings = false;
  return options;
}

TEST(ReferenceMechanism, pendulum_swings_with_the_period_of_the_elliptic_integral) {
  Model model = planar_arm();
  model.links.pop_back();
  model.joints.pop_back();
  const double amplitude = 2.0, inertia = 0.05 + 2.0 * 0.2 * 0.2;  // by the parallel axis theorem
  model.joints[0].position = -std::numbers::pi / 2 + amplitude;
  const Mechanism pendulum(model);
  const State start = pendulum.initial_state();
  EXPECT_NEAR(pendulum.mass_matrix(start)(0, 0), inertia, 1e-15);
  EXPECT_NEAR(pendulum.bias(start)[0], 2.0 * 9.81 * 0.2 * std::cos(start.q[0]), 1e-13);

  const double frequency = std::sqrt(2.0 * 9.81 * 0.2 / inertia);
  const double quarter = std::comp_ellint_1(std::sin(amplitude / 2)) / frequency;
  const Motion motion = integrate(pendulum, start, held, quarter, 4, 200);
  EXPECT_NEAR(motion.positions(1, 0), -std::numbers::pi / 2, 1e-7);
  EXPECT_NEAR(motion.positions(2, 0), -std::numbers::pi / 2 - amplitude, 1e-7);
  EXPECT_NEAR(motion.positions(4, 0), start.q[0], 1e-7);
}

// The planar elbow manipulator of Spong, Hutchinson, Vidyasagar: Robot modeling and control.
TEST(ReferenceMechanism, double_pendulum_has_the_textbook_mass_matrix_and_bias) {
  const Mechanism arm(planar_arm());
  State state = arm.initial_state();
  state.q << 0.7, -1.1;
  state.v << 1.3, -0.4;
  const double m1 = 2.0, m2 = 1.0, l1 = 0.5, c1 = 0.2, c2 = 0.3, i1 = 0.05, i2 = 0.03, g = 9.81;
  const double cosine = std::cos(state.q[1]), sine = std::sin(state.q[1]), sum = state.q[0] + state.q[1];
  MatrixXd mass(2, 2);
  mass(0, 0) = m1 * c1 * c1 + m2 * (l1 * l1 + c2 * c2 + 2 * l1 * c2 * cosine) + i1 + i2;
  mass(0, 1) = mass(1, 0) = m2 * (c2 * c2 + l1 * c2 * cosine) + i2;
  mass(1, 1) = m2 * c2 * c2 + i2;
  const double coriolis = -m2 * l1 * c2 * sine;
  VectorXd bias(2);
  bias[0] = coriolis * (2 * state.v[0] * state.v[1] + state.v[1] * state.v[1]) +
            (m1 * c1 + m2 * l1) * g * std::cos(state.q[0]) + m2 * c2 * g * std::cos(sum);
  bias[1] = -coriolis * state.v[0] * state.v[0] + m2 * c2 * g * std::cos(sum);
  EXPECT_LT(difference(arm.mass_matrix(state), mass), 1e-14);
  EXPECT_LT(difference(arm.bias(state), bias), 1e-13);
}

// Featherstone (2008), (2.63) and (2.61): I a + v x* I v = f with the spatial inertia about the origin of the root
// frame. If the centre of mass is there, these are Euler's I dw/dt + w x I w = 0 and m (dv/dt + w x v) = m R^T g.
TEST(ReferenceMechanism, single_body_obeys_euler_and_newton_in_its_own_axes) {
  for (const Vector3d& center : {Vector3d(0, 0, 0), Vector3d(0.1, -0.2, 0.3)}) {
    Model model;
    model.roots = {{"body", true}};
    model.roots[0].pose.rotate(Eigen::AngleAxisd(1.1, Vector3d(1, 2, 3).normalized()));
    model.roots[0].velocity << 0.3, -1.2, 0.8, 0.5, 0.1, -0.7;
    model.links = {{"body", {1.5, center, Vector3d(0.1, 0.2, 0.25).asDiagonal()}}};
    const Mechanism body(model);
    const State state = body.initial_state();

    const Matrix3d k = 1.5 * cross(center);
    MatrixXd mass(6, 6), cross_force = MatrixXd::Zero(6, 6);
    mass << Matrix3d(model.links[0].inertia.about_center - k * cross(center)), k, -k, 1.5 * Matrix3d::Identity();
    const Matrix3d w = cross(state.v.head<3>()), u = cross(state.v.tail<3>());
    cross_force << w, u, Matrix3d::Zero(), w;
    VectorXd weight = VectorXd::Zero(6);
    weight.tail(3) = model.roots[0].pose.linear().transpose() * model.gravity;
    EXPECT_LT(difference(body.mass_matrix(state), mass), 1e-14);
    EXPECT_LT(difference(body.bias(state), cross_force * mass * state.v - mass * weight), 1e-13);
    if (center.isZero()) {
      const Vector3d omega = state.v.head<3>(), spin = mass.topLeftCorner<3, 3>() * omega;
      EXPECT_LT(difference(body.bias(state).head<3>(), omega.cross(spin)), 1e-13);
    }
  }
}

// With a fixed root the q are coordinates, so c_i = d/dt (M v)_i - 1/2 v^T dM/dq_i v + dV/dq_i.
TEST(ReferenceMechanism, bias_satisfies_lagranges_equations) {
  for (int seed = 0; seed < 20; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed, conservative(scenes::RandomOptions::Root::fixed)));
    const State state = mechanism.initial_state();
    const auto moved = [&](const VectorXd& dq) {
      State s = state;
      s.q += dq;
      return s;
    };
    const double e = 1e-5;
    const auto mass_rate = [&](const VectorXd& dq) -> MatrixXd {
      return (mechanism.mass_matrix(moved(e * dq)) - mechanism.mass_matrix(moved(-e * dq))) / (2 * e);
    };
    VectorXd lagrange = mass_rate(state.v) * state.v;
    for (int i = 0; i < mechanism.dofs(); ++i) {
      const VectorXd dq = VectorXd::Unit(mechanism.dofs(), i);
      lagrange[i] -= 0.5 * state.v.dot(mass_rate(dq) * state.v);
      lagrange[i] += (mechanism.potential_energy(moved(e * dq)) - mechanism.potential_energy(moved(-e * dq))) / (2 * e);
    }
    EXPECT_LT(difference(mechanism.bias(state), lagrange), 1e-7) << seed;
  }
}

// The rate of change of energy is the power of efforts, drives and damping. There are no springs, and hard couplings do
// no work.
TEST(ReferenceMechanism, energy_changes_by_the_power_of_the_forces) {
  scenes::RandomOptions options;
  options.max_dofs = 10;
  options.soft = scenes::RandomOptions::Soft::never;
  options.coupling_error = false;
  for (int seed = 0; seed < 30; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed, options));
    const State state = mechanism.initial_state();
    const double e = 1e-6;
    const auto energy = [&](double time) {
      const State end = integrate(mechanism, state, held, time, 1, 1).end;
      return mechanism.kinetic_energy(end) + mechanism.potential_energy(end);
    };
    const double power = state.v.dot(mechanism.joint_forces(state, mechanism.initial_inputs()));
    EXPECT_NEAR((energy(e) - energy(-e)) / (2 * e), power, 1e-4 * (1 + std::abs(power))) << seed;
  }
}

TEST(ReferenceMechanism, energy_is_kept_without_forces) {
  for (int seed = 0; seed < 10; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed, conservative(scenes::RandomOptions::Root::either)));
    const State start = mechanism.initial_state(), end = integrate(mechanism, start, held, 0.3, 1, 600).end;
    EXPECT_NEAR(mechanism.kinetic_energy(end) + mechanism.potential_energy(end),
                mechanism.kinetic_energy(start) + mechanism.potential_energy(start), 1e-7)
        << seed;
  }
}

// chain32 starts straight, so its energy can be summed by hand: each link turns by the sum of the joints before it and
// moves the next link by its length. Couplings and damping are internal forces.
TEST(ReferenceMechanism, floating_chain_keeps_its_momentum) {
  const double length = 0.1, mass = 0.2, inertia = mass / 12 * (length * length + 0.04 * 0.04);
  double energy = 0.0, turn_y = 0.0, turn_z = 0.0, up = 0.0, left = 0.0;
  for (int i = 0; i < 32; ++i) {
    (i % 2 == 0 ? turn_y : turn_z) += i % 2 == 0 ? 1.0 : -1.0;
    energy += mass / 2 * (std::pow(up - turn_y * length / 2, 2) + std::pow(left + turn_z * length / 2, 2)) +
              inertia / 2 * (turn_y * turn_y + turn_z * turn_z);
    up -= turn_y * length;
    left += turn_z * length;
  }
  const Mechanism chain(scenes::chain32());
  const State start = chain.initial_state(), end = integrate(chain, start, held, 0.05, 1, 400).end;
  EXPECT_NEAR(chain.kinetic_energy(start), energy, 1e-10);
  EXPECT_LT(difference(chain.momentum(end), chain.momentum(start)), 1e-10);
}

// Weight is the only external force: dp/dt = m g and dL/dt = centre of mass x m g. The part of M v that belongs to the
// root is the momentum.
TEST(ReferenceMechanism, momentum_changes_by_the_weight_and_is_the_roots_share_of_m_v) {
  scenes::RandomOptions options = conservative(scenes::RandomOptions::Root::floating);
  options.damping = options.drives = options.efforts = true;
  options.armature = false;
  for (int seed = 0; seed < 20; ++seed) {
    const Model model = scenes::random_model(seed, options);
    const Mechanism mechanism(model);
    const State state = mechanism.initial_state();
    Vector3d moment = Vector3d::Zero();
    double heavy = 0.0;  // mass, each link's by its share of gravity
    const auto poses = mechanism.link_poses(state);
    for (int l = 0; l < mechanism.links(); ++l) {
      const double share = model.links[l].gravity * model.links[l].inertia.mass;
      heavy += share;
      moment += share * (poses[l] * model.links[l].inertia.center);
    }
    const double e = 1e-4;
    const Vector6d rate = (mechanism.momentum(integrate(mechanism, state, held, e, 1, 2).end) -
                           mechanism.momentum(integrate(mechanism, state, held, -e, 1, 2).end)) /
                          (2 * e);
    Vector6d weight;
    weight << moment.cross(model.gravity), heavy * model.gravity;
    EXPECT_LT(difference(rate, weight), 1e-4) << seed;

    const VectorXd share = (mechanism.mass_matrix(state) * state.v).head<6>();
    const Vector3d linear = state.roots[0].orientation * Vector3d(share.tail<3>());
    Vector6d momentum;
    momentum << state.roots[0].orientation * Vector3d(share.head<3>()) + state.roots[0].position.cross(linear), linear;
    EXPECT_LT(difference(momentum, mechanism.momentum(state)), 1e-12) << seed;
  }
}

TEST(ReferenceMechanism, fixed_joint_makes_one_body_of_two_links) {
  Model two = planar_arm();
  two.links.push_back({"tool", {0.7, {0.1, 0.05, 0}, Vector3d(0.002, 0.003, 0.004).asDiagonal()}});
  Joint weld = revolute("weld", "lower", "tool", {0.4, 0, 0.1}, Vector3d::UnitX());
  weld.kind = JointKind::fixed;
  weld.origin.rotate(Eigen::AngleAxisd(0.6, Vector3d(1, 1, 0).normalized()));
  two.joints.push_back(weld);
  Model one = planar_arm();
  one.links[2].inertia = one.links[2].inertia + transformed(two.links[3].inertia, weld.origin);
  const Mechanism welded(two), one_body(one);
  State state = welded.initial_state();
  state.q << 0.4, 1.2;
  state.v << -2.0, 0.7;
  EXPECT_LT(difference(welded.mass_matrix(state), one_body.mass_matrix(state)), 1e-14);
  EXPECT_LT(difference(welded.bias(state), one_body.bias(state)), 1e-13);
}

TEST(ReferenceMechanism, jacobians_and_velocities_are_rates_of_poses) {
  for (int seed = 0; seed < 20; ++seed) {
    const Model model = scenes::random_model(seed);
    const Mechanism mechanism(model);
    const State state = mechanism.initial_state();
    const double e = 1e-6;
    const State ahead = mechanism.advanced(state, state.v, e), behind = mechanism.advanced(state, state.v, -e);
    const auto poses_ahead = mechanism.link_poses(ahead), poses_behind = mechanism.link_poses(behind),
               poses = mechanism.link_poses(state);
    for (int l = 0; l < mechanism.links(); ++l) {
      const Vector6d velocity = mechanism.link_velocity(state, l);
      const Matrix3d turning = (poses_ahead[l].linear() - poses_behind[l].linear()) / (2 * e);
      EXPECT_LT(difference(turning, cross(velocity.head<3>()) * poses[l].linear()), 1e-8);
      const Vector3d moved = poses_ahead[l].translation() - poses_behind[l].translation();
      EXPECT_LT(difference(moved, 2 * e * velocity.tail<3>()), 1e-13);
    }
    for (int s = 0; s < 2; ++s)
      EXPECT_LT(difference(mechanism.site_position(ahead, s) - mechanism.site_position(behind, s),
                           2 * e * (mechanism.site_jacobian(state, s) * state.v).tail<3>()),
                1e-13);
  }
}

TEST(ReferenceMechanism, root_turns_by_the_exponential_and_moves_in_its_own_axes) {
  Model model = planar_arm();
  model.roots = {{model.links[0].name, true}};
  model.links[0].inertia = Inertia::box(1.0, {0.1, 0.1, 0.1}, {0, 0, 0});
  model.roots[0].pose = Eigen::AngleAxisd(0.5, Vector3d::UnitZ());
  const Mechanism mechanism(model);
  VectorXd v = VectorXd::Zero(8);
  v << 0, 0, 3.0, 2.0, 0, 0, 1.0, -1.0;
  const State end = mechanism.advanced(mechanism.initial_state(), v, 0.7);
  const Matrix3d turned = Eigen::AngleAxisd(0.5 + 0.7 * 3.0, Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_LT(difference(end.roots[0].orientation.toRotationMatrix(), turned), 1e-15);
  EXPECT_LT(difference(end.roots[0].position, 1.4 * Vector3d(std::cos(0.5), std::sin(0.5), 0)), 1e-15);
  EXPECT_LT(difference(end.q, Eigen::Vector2d(0.7, -0.7)), 1e-15);
}

// A force F at the tip is the wrench (r x F, F) about the origin of the link. The joint torques follow from the levers.
TEST(ReferenceMechanism, wrench_acts_about_the_link_frames_origin_in_world_axes) {
  const Mechanism arm(planar_arm());
  State state = arm.initial_state();
  state.q << 0.5, 0.8;
  const Vector3d elbow = 0.5 * Vector3d(std::cos(0.5), std::sin(0.5), 0);
  const Vector3d lever = 0.4 * Vector3d(std::cos(1.3), std::sin(1.3), 0), force(2.0, -3.0, 1.0);
  MatrixXd wrenches = MatrixXd::Zero(6, 3);
  wrenches.col(2) << lever.cross(force), force;
  const VectorXd torques = arm.wrench_forces(state, wrenches);
  EXPECT_NEAR(torques[0], (elbow + lever).cross(force)[2], 1e-14);
  EXPECT_NEAR(torques[1], lever.cross(force)[2], 1e-14);
}

// There is no response across a fixed root, but there is one across a floating root.
TEST(ReferenceMechanism, impulses_do_not_cross_a_fixed_root) {
  Model model = planar_arm();
  model.links[0].inertia = Inertia::box(3.0, {0.2, 0.2, 0.2}, {0, 0, 0});
  model.joints[1].parent = "base";
  model.joints[1].origin.translation() = Vector3d(-0.1, 0, 0);
  for (const bool floating : {false, true}) {
    model.roots = {{model.links[0].name, floating}};
    const Mechanism mechanism(model);
    const MatrixXd inverse = mechanism.mass_matrix(mechanism.initial_state()).inverse();
    const double across = inverse.bottomRightCorner<2, 2>()(0, 1);
    if (floating)
      EXPECT_GT(std::abs(across), 1e-3);
    else
      EXPECT_EQ(across, 0.0);
  }
}

// A rotor with inertia I behind a gear of ratio n acts like an armature n^2 I, in the exact motion and in steps.
TEST(ReferenceMechanism, geared_rotor_acts_like_an_armature) {
  const double n = 30.0, inertia = 2e-5;
  Model armature = planar_arm(), rotor = planar_arm();
  armature.joints[0].armature = n * n * inertia;
  rotor.links.push_back({"rotor", {0.01, {0, 0, 0}, inertia * Matrix3d::Identity()}});
  rotor.joints.push_back(revolute("motor", "base", "rotor", {0, 0, 0}, Vector3d::UnitX()));
  rotor.couplings = {Coupling::mimic("motor", "shoulder", -n)};
  for (Model* model : {&armature, &rotor}) model->joints[1].velocity = 2.0, model->joints[0].effort = 3.0;

  const Mechanism with_armature(armature), with_rotor(rotor);
  const VectorXd plain = acceleration(with_armature, with_armature.initial_state(), with_armature.initial_inputs());
  const VectorXd geared = acceleration(with_rotor, with_rotor.initial_state(), with_rotor.initial_inputs());
  EXPECT_LT(difference(plain, geared.head(2)), 1e-10);
  for (const Method method : {Method::direct, Method::reduced}) {
    StepSettings settings;
    settings.method = method;
    State a = with_armature.initial_state(), r = with_rotor.initial_state();
    for (int i = 0; i < 50; ++i) {
      a = step(with_armature, settings, a, with_armature.initial_inputs()).state;
      r = step(with_rotor, settings, r, with_rotor.initial_inputs()).state;
    }
    EXPECT_LT(difference(a.v, r.v.head(2)), 1e-9);
    EXPECT_NEAR(r.q[2], n * r.q[0], 1e-9);
  }
}

}  // namespace
}  // namespace lockstep::reference
