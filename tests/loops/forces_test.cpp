// Forces of loops, what diagnostics say of them, and loops beside limits, servos, mimics and contacts.
// SPDX-License-Identifier: Apache-2.0
#include "contact_scenes.h"
#include "loop_runs.h"

namespace lockstep {
namespace {

using namespace loop_models;
using namespace loop_runs;

constexpr double gravity = 9.81;

Model welded(double force_limit = infinity) {
  Model model = on_ground("welded");
  model.links.push_back({"box", Inertia::box(2.0, {0.1, 0.2, 0.3}, {0.05, 0.0, 0.0})});
  model.roots.push_back({.link = "box", .floating = true, .pose = loop_models::at(Vector3d(0.3, -0.2, 1.0))});
  Loop loop;
  loop.name = "hold", loop.kind = LoopKind::weld, loop.second = "box", loop.force_limit = force_limit;
  loop.first_pose = model.roots.back().pose;
  model.loops = {loop};
  return model;
}

Batch<double>::Array force_of(const Batch<double>& batch) {
  const Query query{Quantity::loop_force};
  Batch<double>::Array force(batch.plan().query_rows(query), batch.environments());
  batch.read(std::span(&query, 1), {force.data(), batch.environments(), 1});
  return force;
}

// The weight, and its moment about the second frame's origin.
TEST(LoopForce, of_a_weld_bears_a_body) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(welded(), settings(integrator)), 1, {.threads = 1});
    batch.step(10);
    const double expected[] = {0.0, 0.0, 2.0 * gravity, 0.0, -0.05 * 2.0 * gravity, 0.0};
    const Batch<double>::Array force = force_of(batch);
    for (int k = 0; k < 6; ++k) EXPECT_NEAR(force(k, 0), expected[k], 1e-9) << k;
  }
}

TEST(LoopForce, is_at_most_its_limit) {
  StepSettings s = settings(Integrator::euler);
  s.record_diagnostics = true;
  Batch<double> batch(compile(welded(10.0), s), 1, {.threads = 1});
  batch.step(1);
  EXPECT_NEAR(force_of(batch)(2, 0), 10.0, 1e-9);
  EXPECT_EQ(batch.row_states()(0, 0), 2.0);
  batch.step(239);
  const double acceleration = 10.0 / 2.0 - gravity;
  EXPECT_NEAR(batch.root_velocities()(5, 0), acceleration, 1e-9);  // the torque rows hold its attitude
  Batch<double> held(compile(welded(), s), 1, {.threads = 1});
  held.step(1);
  EXPECT_EQ(held.row_states()(0, 0), 1.0);
  EXPECT_LT(held.row_residuals()(0, 0), 1e-12);
}

// A lever that is pushed harder than its loop holds: from the truth by small steps, and back when it is let go.
TEST(LoopForce, lets_a_leapfrog_slip_beyond_its_limit_and_come_back_within_it) {
  Model model = on_ground("lever");
  model.gravity.setZero();
  model.links.push_back({"arm", Inertia::box(0.5, {0.3, 0.05, 0.05}, {0.15, 0.0, 0.0})});
  Joint joint;
  joint.name = "turn", joint.kind = JointKind::continuous, joint.parent = model.links[0].name, joint.child = "arm",
  joint.axis = Vector3d::UnitY();
  joint.damping = 0.2;
  model.joints = {joint};
  Loop pin;
  pin.name = "pin", pin.first = model.links[0].name, pin.second = "arm", pin.force_limit = 10.0;
  pin.first_pose = pin.second_pose = loop_models::at(Vector3d(0.3, 0.0, 0.0));
  model.loops = {pin};
  const auto pushed = [&](Integrator integrator, double dt, double effort) {
    StepSettings s = settings(integrator);
    s.dt = dt;
    Batch<double> batch(compile(model, s), 1, {.threads = 1});
    batch.efforts().setConstant(effort);
    batch.step(static_cast<int>(std::lround(0.05 / dt)));
    return batch;
  };
  const double truth = pushed(Integrator::euler, 1e-5, 6.0).positions()(0, 0);
  EXPECT_GT(truth, 0.1);
  Batch<double> batch = pushed(Integrator::leapfrog, 1.0 / 240.0, 6.0);
  EXPECT_NEAR(batch.positions()(0, 0), truth, 0.02 * truth);
  EXPECT_NEAR(force_of(batch).topRows(3).abs().maxCoeff(), 10.0, 1e-6);
  batch.efforts().setZero();
  for (int i = 0; i < 240; ++i) {
    batch.step(1);
    EXPECT_LE(force_of(batch).topRows(3).abs().maxCoeff(), 10.0 * (1.0 + 1e-9));
  }
  EXPECT_LT(batch.loop_errors().abs().maxCoeff(), 1e-6);
  EXPECT_LT(pushed(Integrator::leapfrog, 1.0 / 240.0, 2.0).positions()(0, 0), 1e-9);  // within its limit it holds
}

// The frame stays where it is, and the rest of the weight's moment turns the body about it.
TEST(LoopForce, has_a_torque_of_at_most_its_limit) {
  constexpr double limit = 0.5, dt = 1.0 / 240;
  Model model = welded();
  model.loops[0].torque_limit = limit;
  Batch<double> batch(compile(model, settings(Integrator::euler, dt)), 1, {.threads = 1});
  batch.step(1);
  const double inertia = 2.0 / 12.0 * (0.1 * 0.1 + 0.3 * 0.3) + 2.0 * 0.05 * 0.05;  // about y, at the frame
  const double rest = 2.0 * gravity * 0.05 - limit;
  EXPECT_NEAR(force_of(batch)(4, 0), -limit, 1e-9);
  EXPECT_NEAR(batch.root_velocities()(1, 0), dt * rest / inertia, 1e-6);
  EXPECT_NEAR(batch.root_velocities()(5, 0), 0.0, 1e-6);
}

// A soft weld is a spring: it hangs lower by m g / kp, and swings at sqrt(kp / m).
TEST(SoftLoop, yields_by_the_load_over_its_stiffness) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Model model = welded();
    model.loops[0].kind = LoopKind::point;
    model.links[1].inertia.center.setZero();
    model.loops[0].softness = Spring{800.0, 40.0};
    Batch<double> batch(compile(model, settings(integrator)), 1, {.threads = 1});
    batch.step(2400);
    EXPECT_NEAR(batch.root_poses()(2, 0), 1.0 - 2.0 * gravity / 800.0, 1e-6);
    EXPECT_NEAR(batch.loop_errors()(0, 0), 2.0 * gravity / 800.0, 1e-6);
    model.loops[0].softness = Frequency{20.0, 1.0};  // at the mass that it holds: kp = m w^2
    Batch<double> by_frequency(compile(model, settings(integrator)), 1, {.threads = 1});
    by_frequency.step(2400);
    EXPECT_NEAR(by_frequency.root_poses()(2, 0), 1.0 - gravity / 400.0, 1e-6);
  }
}

// The servo of the crank presses the rocker on its range.
TEST(LoopBeside, a_range_stops_the_mechanism_where_a_passive_joint_ends) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Model model = four_bar({.start = {0.5, 0.0}});
    model.joints[0].drive = {.kp = 40.0, .kd = 2.0, .position_target = 2.5};
    model.joints[2].upper = model.joints[2].position + 0.2;
    model.joints[2].lower = model.joints[2].position - 0.2;
    Batch<double> batch(compile(model, settings(integrator)), 1, {.threads = 1});
    double beyond = 0.0, gap = 0.0;
    for (int i = 0; i < 960; ++i) {
      batch.step(1);
      beyond = std::max(
          {beyond, batch.positions()(2, 0) - model.joints[2].upper, model.joints[2].lower - batch.positions()(2, 0)});
      if (i > 480) gap = std::max(gap, batch.loop_errors()(0, 0));
    }
    EXPECT_EQ(batch.faulted(), 0);
    EXPECT_LT(beyond, 1e-9);
    EXPECT_LT(gap, 1e-7);
    EXPECT_LT(batch.velocities().abs().maxCoeff(), 1e-6);
    EXPECT_NEAR(
        std::max(batch.positions()(2, 0) - model.joints[2].upper, model.joints[2].lower - batch.positions()(2, 0)), 0.0,
        1e-9);
  }
}

// The gripper with pads on its fingers, which stand upright where they press, and an object that a weld holds until
// they do. What carries it slides along an axis, or is an arm that turns with servos.
Model carried_gripper(const Vector3d& axis, bool on_arm) {
  constexpr double tilt = 0.2;
  Model model = gripper({.servo = 4.0, .target = 0.5});
  for (Joint& joint : model.joints)
    if (joint.stiffness > 0.0) joint.stiffness = 5.0, joint.damping = 0.05;
  for (const double side : {-1.0, 1.0}) {
    const std::string finger = side < 0.0 ? "left_finger" : "right_finger";
    Collider pad{.name = finger + " pad", .link = finger, .shape = Shape::box({0.01, 0.03, 0.04}), .friction = 0.8};
    pad.pose.rotate(Eigen::AngleAxisd(side * tilt, Vector3d::UnitY()));
    pad.pose.translation() = pad.pose.linear() * Vector3d(0.0, 0.0, 0.045);
    model.colliders.push_back(pad);
    model.links[static_cast<std::size_t>(model.link_index(finger))].inertia =
        Inertia::box(0.04, {0.025, 0.03, 0.05}, {0.0, 0.0, 0.02});
    model.contacts.push_back({pad.name, "object"});
  }
  const Vector3d place(0.0, 0.0, 0.1);
  contact_scenes::add_block(model, "object", 0.05, {0.061, 0.03, 0.04}, place, 0.8);
  Loop hold;
  hold.name = "hold", hold.kind = LoopKind::weld, hold.first = "ground", hold.second = "object";
  hold.first_pose = loop_models::at(place);
  model.loops.push_back(hold);

  // What carries the gripper.
  constexpr double reach = 0.5;
  model.links.push_back({"stand", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())});
  model.roots[0].link = "stand";
  Joint carrier;
  carrier.name = "carrier", carrier.kind = on_arm ? JointKind::revolute : JointKind::prismatic;
  carrier.parent = "stand", carrier.child = on_arm ? "arm" : "ground", carrier.axis = axis;
  if (on_arm) {
    carrier.drive = {.kp = 4000.0, .kd = 120.0};
    model.links.push_back({"arm", Inertia::box(2.0, {0.08, 0.08, reach}, {-0.5 * reach, 0.0, 0.0})});
    Joint flange;
    flange.name = "flange", flange.parent = "arm", flange.child = "ground";
    carrier.origin.translation().x() = -reach, flange.origin.translation().x() = reach;
    model.joints.push_back(flange);
  } else {
    carrier.drive.kinematic = true;
  }
  model.joints.push_back(carrier);
  return model;
}

// How far the object is elsewhere in the left finger after four seconds at 2 g, with slow ends.
double slip_in_hand(const Model& model, Integrator integrator, double lever) {
  constexpr double rate = 2.0 * std::numbers::pi * 5.0, amplitude = 2.0 * gravity / (rate * rate);
  StepSettings s = settings(integrator);
  s.per_environment.insert(Parameter::loop_switch);
  const Plan plan = compile(model, s);
  Batch<double> batch(plan, 1, {.threads = 1});
  const int carrier = plan.dof("carrier");
  const auto in_finger = [&] {
    const Batch<double>::Array finger = batch.link_poses(plan.link("left_finger")),
                               object = batch.link_poses(plan.link("object"));
    const Eigen::Quaterniond turn(finger(3, 0), finger(4, 0), finger(5, 0), finger(6, 0));
    return Vector3d(turn.conjugate() * Vector3d(object.topRows(3).matrix() - finger.topRows(3).matrix()));
  };
  const auto swing = [&](double seconds, double share) {
    const int steps = static_cast<int>(seconds * 240.0 + 0.5);
    for (int i = 1; i <= steps; ++i) {
      const double t = i / 240.0;
      const double grown = contact_scenes::ramp(t, 0.0, 0.5) * (1.0 - contact_scenes::ramp(t, seconds - 0.5, seconds));
      batch.position_targets()(carrier, 0) = share * grown * amplitude / lever * std::sin(rate * t);
      batch.step(1);
    }
  };
  swing(1.0, 0.0);
  batch.parameter(Parameter::loop_switch)(2, 0) = 0.0;  // the fingers have it
  swing(1.0, 0.0);
  const Vector3d before = in_finger();
  swing(4.0, 1.0);
  swing(1.0, 0.0);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_LT(batch.loop_errors().topRows(4).maxCoeff(), 1e-8);
  return (in_finger() - before).norm();
}

TEST(LoopBeside, contacts_lets_a_gripper_hold_a_box_that_is_shaken_at_two_g) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_LT(slip_in_hand(carried_gripper(Vector3d::Unit(axis), false), integrator, 1.0), 1e-5)
          << to_string(integrator) << ", axis " << axis;
}

TEST(LoopBeside, contacts_lets_an_arm_swing_a_held_box_at_two_g) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    EXPECT_LT(slip_in_hand(carried_gripper(Vector3d::UnitY(), true), integrator, 0.5), 1e-4) << to_string(integrator);
}

// Impulses of the mimic, with and without a load on the other side that only the loop passes on.
TEST(LoopBeside, an_eliminated_mimic_reports_the_impulse_that_its_other_finger_needs) {
  Model model = gripper({.springs = true, .servo = 0.0});
  for (Joint& joint : model.joints) joint.damping = 0.01;
  StepSettings s = settings(Integrator::euler);
  s.record_impulses = true;
  Batch<double> batch(compile(model, s), 1, {.threads = 1});
  const int left = batch.plan().dof("left_driver"), right = batch.plan().dof("right_driver");
  batch.efforts()(left, 0) = 0.04;
  batch.step(4800);
  ASSERT_LT(batch.velocities().abs().maxCoeff(), 1e-9);
  const double through = batch.coupling_impulses()(0, 0) * 240.0;
  batch.efforts()(left, 0) = 0.0, batch.efforts()(right, 0) = 0.04;
  batch.step(4800);
  // Both fingers are alike, so each needs half of the effort, wherever it enters.
  EXPECT_NEAR(through, 0.02, 1e-9);
  EXPECT_NEAR(batch.coupling_impulses()(0, 0) * 240.0, -0.02, 1e-9);
}

}  // namespace
}  // namespace lockstep
