// Mechanisms with closed loops, closed at their starts by formula. SPDX-License-Identifier: Apache-2.0
//
// Planar ones lie in the plane x z of their root, with gravity along -z. Their rods turn about -y, so a positive angle
// turns x towards z. Joint velocities of the start fit the loops.
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include "lockstep/model.h"

namespace lockstep::loop_models {

using Eigen::Vector2d;
using Eigen::Vector3d;

inline const Vector3d turning{0.0, -1.0, 0.0};  ///< the axis of planar joints

inline Vector3d in_space(const Vector2d& point) { return {point.x(), 0.0, point.y()}; }

inline Pose at(const Vector3d& place) {
  Pose pose = Pose::Identity();
  pose.translation() = place;
  return pose;
}
inline Pose at(const Vector2d& place) { return at(in_space(place)); }

/// Of a direction with x.
inline double angle_of(const Vector2d& direction) { return std::atan2(direction.y(), direction.x()); }
inline Vector2d along(double angle) { return {std::cos(angle), std::sin(angle)}; }
inline double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }
inline Vector2d turned(const Vector2d& a) { return {-a.y(), a.x()}; }  // by a quarter

/// The angle brought to (-pi, pi].
inline double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

/// Position and velocity of a point in the plane.
struct Moving {
  Vector2d place, velocity = Vector2d::Zero();
};

/// Where rods of lengths a and b that start at two points meet. `side` is 1 to the left of the way from the first to
/// the second, -1 to its right.
inline Moving meeting(const Moving& first, double a, const Moving& second, double b, double side) {
  const Vector2d way = second.place - first.place;
  const double distance = way.norm(), x = (distance * distance + a * a - b * b) / (2.0 * distance);
  const double y = side * std::sqrt(a * a - x * x);
  Moving meeting{first.place + (x * way + y * turned(way)) / distance};
  // Neither rod changes its length.
  Eigen::Matrix2d rods;
  rods << (meeting.place - first.place).transpose(), (meeting.place - second.place).transpose();
  meeting.velocity = rods.inverse() * Vector2d((meeting.place - first.place).dot(first.velocity),
                                               (meeting.place - second.place).dot(second.velocity));
  return meeting;
}

/// Angle of the rod from one point to another, and its speed.
struct Turn {
  double angle, speed;
};
inline Turn turn_of(const Moving& from, const Moving& to) {
  const Vector2d rod = to.place - from.place;
  return {angle_of(rod), cross(rod, to.velocity - from.velocity) / rod.squaredNorm()};
}

/// The end of a rod that starts at a point that rests.
inline Moving rod_end(const Vector2d& pivot, double length, const Turn& turn) {
  return {pivot + length * along(turn.angle), length * turn.speed * turned(along(turn.angle))};
}

/// A rod along x of its frame, which is at its start.
inline Inertia rod(double mass, double length, double thickness = 0.02) {
  return Inertia::box(mass, {length, thickness, thickness}, {length / 2.0, 0.0, 0.0});
}

/// Adds a link and the joint that carries it; the joint has the link's name.
inline Joint& add(Model& model, const std::string& name, const Inertia& inertia, JointKind kind,
                  const std::string& parent, const Pose& origin, const Vector3d& axis, double position,
                  double velocity = 0.0) {
  model.links.push_back({name, inertia});
  Joint joint;
  joint.name = name, joint.kind = kind, joint.parent = parent, joint.child = name, joint.origin = origin;
  joint.axis = axis, joint.position = position, joint.velocity = velocity;
  model.joints.push_back(joint);
  return model.joints.back();
}

inline Joint& add_rod(Model& model, const std::string& name, double mass, double length, const std::string& parent,
                      const Vector2d& origin, const Turn& turn) {
  return add(model, name, rod(mass, length), JointKind::revolute, parent, at(origin), turning, wrapped(turn.angle),
             turn.speed);
}

/// The same on a rod that turns itself.
inline Joint& add_rod_on(Model& model, const std::string& name, double mass, double length, const std::string& parent,
                         double parent_length, const Turn& parent_turn, const Turn& turn) {
  return add_rod(model, name, mass, length, parent, {parent_length, 0.0},
                 {turn.angle - parent_turn.angle, turn.speed - parent_turn.speed});
}

/// A model with a root that is bolted to the world.
inline Model on_ground(const std::string& name) {
  Model model;
  model.name = name;
  model.links = {{"ground", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())}};
  model.roots = {{"ground"}};
  return model;
}

/// Holds a place on one link to a place on another; axes of hinges are those of planar joints.
inline Loop& add_loop(Model& model, LoopKind kind, const std::string& first, const Vector3d& in_first,
                      const std::string& second, const Vector3d& in_second) {
  Loop loop;
  loop.name = "loop" + std::to_string(model.loops.size());
  loop.kind = kind, loop.first = first, loop.second = second, loop.axis = turning;
  loop.first_pose = at(in_first), loop.second_pose = at(in_second);
  model.loops.push_back(loop);
  return model.loops.back();
}

/// A four-bar, crank, coupler and rocker: 3 joints, 1 degree of freedom. The crank of this one turns round.
struct FourBar {
  double ground = 0.4, crank = 0.15, coupler = 0.4, rocker = 0.3;  ///< m
  Turn start = {0.5, 15.0};                                        ///< of the crank, rad and rad/s
  double side = 1.0;                                               ///< of meeting()
  LoopKind kind = LoopKind::point;
  int loops = 1;  ///< more hold the same again
};
inline Model four_bar(const FourBar& bars = {}) {
  Model model = on_ground("four_bar");
  const Vector2d pivot(bars.ground, 0.0);
  const Moving knee = rod_end(Vector2d::Zero(), bars.crank, bars.start);
  const Moving end = meeting(knee, bars.coupler, {pivot}, bars.rocker, bars.side);
  const Turn coupler = turn_of(knee, end), rocker = turn_of({pivot}, end);
  add_rod(model, "crank", 1.0, bars.crank, "ground", Vector2d::Zero(), bars.start);
  add_rod_on(model, "coupler", 0.4, bars.coupler, "crank", bars.crank, bars.start, coupler);
  add_rod(model, "rocker", 0.3, bars.rocker, "ground", pivot, rocker);
  for (int i = 0; i < bars.loops; ++i)
    add_loop(model, bars.kind, "coupler", {bars.coupler, 0, 0}, "rocker", {bars.rocker, 0, 0});
  return model;
}

/// Flat twice a turn, where it may change its branch.
inline Model parallelogram(double speed = 10.0) {
  Model model = four_bar({.ground = 0.4, .crank = 0.2, .coupler = 0.4, .rocker = 0.2, .start = {1.0, speed}});
  model.name = "parallelogram";
  return model;
}

/// Crank, rod and a block that slides along x. The block hangs on the ground, and a point or a hinge holds it to the
/// rod; or it hangs on the rod, and a slider holds it to the world: 3 joints, 1 degree of freedom.
inline Model slider_crank(LoopKind kind = LoopKind::point, double speed = 15.0) {
  constexpr double crank_length = 0.1, rod_length = 0.3;
  Model model = on_ground("slider_crank");
  const Turn crank{0.7, speed};
  const Moving knee = rod_end(Vector2d::Zero(), crank_length, crank);
  const double height = knee.place.y(), reach = std::sqrt(rod_length * rod_length - height * height);
  const Moving end{{knee.place.x() + reach, 0.0}, {knee.velocity.x() - height / reach * knee.velocity.y(), 0.0}};
  const Turn connecting = turn_of(knee, end);
  add_rod(model, "crank", 1.0, crank_length, "ground", Vector2d::Zero(), crank);
  add_rod_on(model, "rod", 0.3, rod_length, "crank", crank_length, crank, connecting);
  const Inertia block = Inertia::box(0.5, {0.06, 0.04, 0.04}, Vector3d::Zero());
  if (kind == LoopKind::slider) {
    add(model, "block", block, JointKind::revolute, "rod", at(Vector2d(rod_length, 0.0)), turning, -connecting.angle,
        -connecting.speed);
    add_loop(model, kind, "", Vector3d::Zero(), "block", Vector3d::Zero()).axis = Vector3d::UnitX();
  } else {
    add(model, "block", block, JointKind::prismatic, "ground", Pose::Identity(), Vector3d::UnitX(), end.place.x(),
        end.velocity.x());
    add_loop(model, kind, "rod", {rod_length, 0, 0}, "block", Vector3d::Zero());
  }
  return model;
}

/// Two cranks, each with a rod, and the ends of the rods together: 4 joints, 2 degrees of freedom.
inline Model five_bar(const Turn& left = {2.0, 6.0}, const Turn& right = {0.8, -4.0}) {
  constexpr double ground = 0.3, crank = 0.2, length = 0.35;
  Model model = on_ground("five_bar");
  const Vector2d pivot(ground, 0.0);
  const Moving left_knee = rod_end(Vector2d::Zero(), crank, left), right_knee = rod_end(pivot, crank, right);
  const Moving end = meeting(left_knee, length, right_knee, length, 1.0);
  add_rod(model, "left_crank", 0.5, crank, "ground", Vector2d::Zero(), left);
  add_rod_on(model, "left_rod", 0.3, length, "left_crank", crank, left, turn_of(left_knee, end));
  add_rod(model, "right_crank", 0.5, crank, "ground", pivot, right);
  add_rod_on(model, "right_rod", 0.3, length, "right_crank", crank, right, turn_of(right_knee, end));
  add_loop(model, LoopKind::point, "left_rod", {length, 0, 0}, "right_rod", {length, 0, 0});
  return model;
}

/// A platform that floats on six legs, of two turns and a slide with a spring each: 24 velocities, 6 points, 6 degrees
/// of freedom. It turns and moves at the start.
inline Model stewart(double stiffness = 2000.0, double damping = 0.0) {
  constexpr double base_radius = 0.5, platform_radius = 0.3, leg = 0.5;
  Model model = on_ground("stewart");
  Root platform{.link = "platform", .floating = true, .pose = at(Vector3d(0.03, -0.02, 0.6))};
  platform.pose.rotate(Eigen::AngleAxisd(0.15, Vector3d(1.0, -2.0, 3.0).normalized()));
  platform.velocity << 0.8, -0.5, 0.6, 0.2, 0.3, -0.4;
  model.links.push_back({"platform", Inertia::box(4.0, {0.5, 0.5, 0.05}, Vector3d::Zero())});
  model.roots.push_back(platform);
  for (int i = 0; i < 6; ++i) {
    const double side = i % 2 == 0 ? -1.0 : 1.0, third = (i / 2) * 2.0 * std::numbers::pi / 3.0;
    const double base_angle = third + side * 0.9, angle = third + side * 0.2;
    const Vector3d base(base_radius * std::cos(base_angle), base_radius * std::sin(base_angle), 0.0);
    const Vector3d anchor(platform_radius * std::cos(angle), platform_radius * std::sin(angle), 0.0);
    // d = |d| (sin b, -sin a cos b, cos a cos b) for turns a about x and b about y.
    const Vector3d d = platform.pose * anchor - base;
    const Vector3d speed = platform.pose.linear() * (Vector3d(platform.velocity.head<3>()).cross(anchor) +
                                                     Vector3d(platform.velocity.tail<3>()));
    const double length = d.norm(), lengthening = d.dot(speed) / length, sine = d.x() / length;
    const double a = std::atan2(-d.y(), d.z()), b = std::asin(sine);
    const double a_speed = (d.y() * speed.z() - d.z() * speed.y()) / (d.y() * d.y() + d.z() * d.z());
    const double b_speed = (speed.x() - sine * lengthening) / (length * std::cos(b));
    const std::string number = std::to_string(i);
    add(model, "swing" + number, Inertia::box(0.1, {0.04, 0.04, 0.04}, Vector3d::Zero()), JointKind::revolute, "ground",
        at(base), Vector3d::UnitX(), a, a_speed);
    add(model, "tilt" + number, Inertia::box(0.3, {0.03, 0.03, 0.4}, {0.0, 0.0, 0.2}), JointKind::revolute,
        "swing" + number, Pose::Identity(), Vector3d::UnitY(), b, b_speed);
    Joint& slide =
        add(model, "slide" + number, Inertia::box(0.2, {0.02, 0.02, 0.4}, {0.0, 0.0, -0.2}), JointKind::prismatic,
            "tilt" + number, at(Vector3d(0.0, 0.0, leg)), Vector3d::UnitZ(), length - leg, lengthening);
    slide.stiffness = stiffness, slide.damping = damping, slide.rest = slide.position;
    add_loop(model, LoopKind::point, "slide" + number, Vector3d::Zero(), "platform", anchor);
  }
  return model;
}

/// A bar with two slides and a turn, welded at its ends to two arms of three joints with servos: 9 joints, 12 rows of
/// which 6 are independent, 3 degrees of freedom. It rests at its start but for the servos, which give way to weight.
inline Model bar_on_arms() {
  constexpr double upper = 0.3, fore = 0.3, hand = 0.1, half = 0.2;
  Model model = on_ground("bar_on_arms");
  const Vector2d middle(0.0, 0.45);
  const double tilt = 0.2;
  add(model, "slide_x", Inertia::box(0.1, {0.05, 0.05, 0.05}, Vector3d::Zero()), JointKind::prismatic, "ground",
      Pose::Identity(), Vector3d::UnitX(), middle.x());
  add(model, "slide_z", Inertia::box(0.1, {0.05, 0.05, 0.05}, Vector3d::Zero()), JointKind::prismatic, "slide_x",
      Pose::Identity(), Vector3d::UnitZ(), middle.y());
  add(model, "bar", Inertia::box(1.0, {2.0 * half, 0.04, 0.04}, Vector3d::Zero()), JointKind::revolute, "slide_z",
      Pose::Identity(), turning, tilt);
  for (const double side : {-1.0, 1.0}) {
    const std::string arm = side < 0.0 ? "left" : "right";
    const Vector2d shoulder(side * 0.4, 0.0), end = middle + side * half * along(tilt);
    const Turn last{tilt + std::numbers::pi / 2.0 * (1.0 + 0.2 * side), 0.0};  // the hand, up to the bar
    const Moving wrist{end - hand * along(last.angle)};
    const Moving elbow = meeting({shoulder}, upper, wrist, fore, -side);
    const Turn first = turn_of({shoulder}, elbow), second = turn_of(elbow, wrist);
    add_rod(model, arm + "_upper", 0.5, upper, "ground", shoulder, first);
    add_rod_on(model, arm + "_fore", 0.4, fore, arm + "_upper", upper, first, second);
    add_rod_on(model, arm + "_hand", 0.2, hand, arm + "_fore", fore, second, last);
    Loop& weld = add_loop(model, LoopKind::weld, arm + "_hand", {hand, 0, 0}, "bar", {side * half, 0, 0});
    weld.first_pose.rotate(Eigen::AngleAxisd(tilt - last.angle, turning));
  }
  for (Joint& joint : model.joints)
    if (joint.kind == JointKind::revolute && joint.name != "bar")
      joint.drive = {.kp = 40.0, .kd = 4.0, .position_target = joint.position};
  return model;
}

/// A gripper of two fingers in the way of the Robotiq 2F-85, each with a driver and a coupler, a spring link and the
/// finger on it, and a loop between coupler and finger. The drivers are coupled: 8 joints, 3 degrees of freedom.
struct Gripper {
  bool springs = true;  ///< and damping, without which nothing holds the spring links
  double servo = 2.0;   ///< kp of the left driver, N m / rad; 0: none
  double target = 0.3;  ///< from the start, rad
  Softness mimic = Hard{1.0};
};
inline Model gripper(const Gripper& parts = {}) {
  constexpr double driver_length = 0.03, coupler_length = 0.04, link_length = 0.05, lever = 0.025;
  Model model = on_ground("gripper");
  for (const double side : {-1.0, 1.0}) {
    // The right finger by formula, the left one as its mirror image: axes turn, places change the sign of x.
    const std::string finger = side < 0.0 ? "left_" : "right_";
    const Vector2d driver_pivot(0.03, 0.0), link_pivot(0.012, 0.01);
    const Turn driver{0.6, 0.0}, link{1.2, 0.0};
    const Moving knee = rod_end(driver_pivot, driver_length, driver), heel = rod_end(link_pivot, link_length, link);
    const Moving pin = meeting(knee, coupler_length, heel, lever, -1.0);
    const Turn coupler = turn_of(knee, pin), tip = turn_of(heel, pin);
    const auto mirrored = [&](double length) { return Vector3d(side * length, 0.0, 0.0); };
    const auto part = [&](const std::string& name, double mass, double length, const std::string& parent,
                          const Vector2d& place, double angle) -> Joint& {
      return add(model, finger + name, Inertia::box(mass, {length, 0.015, 0.01}, mirrored(length / 2.0)),
                 JointKind::revolute, parent, at(Vector2d(side * place.x(), place.y())), side * turning,
                 wrapped(angle));
    };
    part("driver", 0.02, driver_length, "ground", driver_pivot, driver.angle).armature = 0.001;
    part("coupler", 0.02, coupler_length, finger + "driver", {driver_length, 0.0}, coupler.angle - driver.angle);
    Joint& spring_link = part("spring_link", 0.03, link_length, "ground", link_pivot, link.angle);
    if (parts.springs) spring_link.stiffness = 0.5, spring_link.damping = 0.005, spring_link.rest = link.angle;
    Joint& tip_joint = part("finger", 0.04, lever, finger + "spring_link", {link_length, 0.0}, tip.angle - link.angle);
    if (parts.springs) tip_joint.damping = 0.001;
    add_loop(model, LoopKind::point, finger + "coupler", mirrored(coupler_length), finger + "finger", mirrored(lever));
  }
  Joint& driver = model.joints.front();
  if (parts.servo > 0.0)
    driver.drive = {.kp = parts.servo, .kd = 0.1, .position_target = driver.position + parts.target};
  model.couplings = {Coupling::mimic("right_driver", "left_driver", -1.0, 0.0, parts.mimic)};
  return model;
}

}  // namespace lockstep::loop_models
