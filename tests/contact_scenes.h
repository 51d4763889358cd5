// Scenes with contacts: blocks, a gripper of sliding pads, a finger at a wall, a quadruped. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include <cmath>
#include <random>
#include <string>

#include "lockstep/lockstep.h"

namespace lockstep::contact_scenes {

using Eigen::Vector3d;

/// From 0 at `a` to 1 at `b`, smooth.
inline double ramp(double t, double a, double b) {
  const double s = std::min(1.0, std::max(0.0, (t - a) / (b - a)));
  return s * s * (3.0 - 2.0 * s);
}

inline Pose at(const Vector3d& place) {
  Pose pose = Pose::Identity();
  pose.translation() = place;
  return pose;
}

/// All numbers of a quantity, [rows][environments].
template <class S>
Eigen::ArrayXXd read(const Batch<S>& batch, Quantity quantity) {
  const Query query{quantity};
  typename Batch<S>::Array numbers(batch.plan().query_rows(query), batch.environments());
  batch.read(std::span(&query, 1), {numbers.data(), batch.environments(), 1});
  return numbers.template cast<double>();
}

/// Those of the last call of step().
template <class S>
Eigen::ArrayXXd counts_of(const Batch<S>& batch) {
  return read(batch, Quantity::solve_counts);
}

/// Adds a free body with one collider of the same name.
inline Root& add_free(Model& model, const std::string& name, const Inertia& inertia, const Shape& shape,
                      const Vector3d& place, double friction) {
  model.links.push_back({name, inertia});
  Root root;
  root.link = name, root.floating = true, root.pose = at(place);
  model.roots.push_back(root);
  model.colliders.push_back({.name = name, .link = name, .shape = shape, .friction = friction});
  return model.roots.back();
}

inline Root& add_block(Model& model, const std::string& name, double mass, const Vector3d& size, const Vector3d& place,
                       double friction) {
  return add_free(model, name, Inertia::box(mass, size, Vector3d::Zero()), Shape::box(size), place, friction);
}

inline void add_floor(Model& model, double friction) {
  model.colliders.push_back({.name = "floor", .shape = Shape::half_space(), .friction = friction});
}

/// A block of 1 kg on the level.
inline Model block(double friction = 0.5) {
  Model model;
  model.name = "block";
  add_block(model, "block", 1.0, {0.1, 0.1, 0.1}, {0, 0, 0.05}, friction);
  add_floor(model, friction);
  model.contacts = {{"floor", "block"}};
  return model;
}

/// The block on a slope, which is gravity turned by `share` of the friction angle.
inline Model slope(double share) {
  Model model = block();
  const double angle = share * std::atan(0.5);
  model.gravity = {9.81 * std::sin(angle), 0.0, -9.81 * std::cos(angle)};
  return model;
}

/// Three blocks that drop 1 mm onto each other, off centre.
inline Model stack(double top) {
  Model model;
  model.name = "stack";
  const double masses[3] = {1.0, 1.0, top};
  const Vector3d places[3] = {{0, 0, 0.05}, {0.005, 0.003, 0.151}, {-0.004, 0.006, 0.252}};
  for (int i = 0; i < 3; ++i)
    add_block(model, "block" + std::to_string(i + 1), masses[i], {0.1, 0.1, 0.1}, places[i], 0.6);
  add_floor(model, 0.6);
  model.contacts = {{"floor", "block1"}, {"block1", "block2"}, {"block2", "block3"}};
  return model;
}

/// Four bodies of every shape that fall onto each other, masses over four decades.
inline Model pile(unsigned seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  Model model;
  model.name = "pile";
  for (int i = 0; i < 4; ++i) {
    const double mass = std::pow(10.0, uniform(-2.0, 2.0)), size = uniform(0.06, 0.12);
    const Vector3d place(uniform(-0.05, 0.05), uniform(-0.05, 0.05), 0.12 + 0.16 * i);
    const std::string name = "body" + std::to_string(i);
    if (i == 1) {
      add_free(model, name, {mass, Vector3d::Zero(), 0.4 * mass * size * size * Eigen::Matrix3d::Identity()},
               Shape::sphere(size / 2), place, uniform(0.2, 1.0));
    } else if (i == 3) {
      add_free(model, name, {mass, Vector3d::Zero(), 0.2 * mass * size * size * Eigen::Matrix3d::Identity()},
               Shape::capsule(size / 3, size), place, uniform(0.2, 1.0));
    } else {
      add_block(model, name, mass, {size, 0.8 * size, 0.7 * size}, place, uniform(0.2, 1.0));
    }
    model.colliders.back().group = "bodies";
  }
  add_floor(model, uniform(0.2, 1.0));
  model.contacts = {{"floor", "bodies"}, {"bodies", "bodies"}};
  return model;
}

/// A ball of 1 kg with radius 0.1 m.
inline Model ball(const Vector3d& place, double friction = 0.5, double restitution = 0.0) {
  Model model;
  model.name = "ball";
  add_free(model, "ball", {1.0, Vector3d::Zero(), 0.004 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.1), place,
           friction);
  add_floor(model, friction);
  for (Collider& collider : model.colliders) collider.restitution = restitution;
  model.contacts = {{"floor", "ball"}};
  return model;
}

inline Joint joint(const std::string& name, JointKind kind, const std::string& parent, const std::string& child,
                   const Vector3d& place, const Vector3d& axis) {
  Joint joint;
  joint.name = name, joint.kind = kind, joint.parent = parent, joint.child = child;
  joint.origin = at(place), joint.axis = axis;
  return joint;
}

/// A palm that slides and turns, with two coupled pads, over a block on the floor.
struct Grasp {
  double mass = 0.1;   ///< of the block, kg
  double shake = 2.0;  ///< times g
  bool wrist_driven = true;
  Vector3d block_at{0, 0, 0.02};  ///< centre of the block

  double squeeze() const { return 10.0 + 30.0 * mass; }

  Model model() const {
    Model m;
    m.name = "grasp";
    const auto body = [&](const char* name, double mass_of, const Vector3d& center, double moment) {
      m.links.push_back({name, {mass_of, center, moment * Eigen::Matrix3d::Identity()}});
    };
    m.links.push_back({"base", {}});
    body("mount", 0.5, Vector3d::Zero(), 1e-3), body("lift", 0.5, Vector3d::Zero(), 1e-3);
    body("palm", 0.5, {0, 0, 0.06}, 1e-3);
    const Vector3d pad{0.01, 0.02, 0.04};
    for (const char* name : {"left", "right"}) {
      m.links.push_back({name, Inertia::box(0.025, pad, Vector3d::Zero())});
      m.colliders.push_back({.name = name, .link = name, .shape = Shape::box(pad), .friction = 0.8});
    }
    m.joints = {joint("y", JointKind::prismatic, "base", "mount", {0, 0, 0.03}, {0, 1, 0}),
                joint("z", JointKind::prismatic, "mount", "lift", {0, 0, 0}, {0, 0, 1}),
                joint("wrist", JointKind::revolute, "lift", "palm", {0, 0, 0}, {0, 0, 1}),
                joint("left", JointKind::prismatic, "palm", "left", {-0.055, 0, 0}, {1, 0, 0}),
                joint("right", JointKind::prismatic, "palm", "right", {0.055, 0, 0}, {-1, 0, 0})};
    m.joints[0].drive = m.joints[1].drive = {.kp = 5e4, .kd = 500.0};
    if (wrist_driven)
      m.joints[2].drive = {.kp = 50.0, .kd = 0.5};
    else
      m.joints[2].damping = 0.02;
    m.joints[3].drive = {.kp = squeeze() / 0.01, .kd = squeeze() / 1.0};
    m.couplings = {Coupling::mimic("right", "left", -1.0)};
    m.roots = {{"base"}};
    add_block(m, "object", mass, {0.04, 0.04, 0.04}, block_at, 0.8);
    add_floor(m, 0.8);
    m.contacts = {{"left", "object"}, {"right", "object"}, {"floor", "object"}};
    return m;
  }

  /// Targets of y, z, wrist and the left pad.
  Eigen::Vector4d targets(double t) const {
    const double pi = 3.14159265358979323846, g = 9.81;
    const double amplitude = shake * g / std::pow(6.0 * pi, 2), r = ramp(t, 1.0, 1.5);
    const bool lifts = wrist_driven;
    return {lifts ? amplitude * r * std::sin(6 * pi * (t - 1)) : 0.0,
            0.1 * ramp(t, 0.5, 1.0) + (lifts ? r * amplitude / 2 * std::sin(4 * pi * (t - 1)) : 0.0),
            lifts ? r / 2 * std::sin(2 * pi * (t - 1)) : 0.0, 0.03 + 0.01 * ramp(t, 0.0, 0.3)};
  }
};

/// A finger of two coupled capsules that a stiff servo presses against a wall.
inline Model wall(double limit = 1.2) {
  Model m;
  m.name = "wall";
  m.links = {{"base", {}}};
  const auto link = [&](const char* name, double mass, double length) {
    const double radius = 0.01, across = mass * (3 * radius * radius + length * length) / 12;
    Inertia inertia{mass, {0, 0, length / 2}, Vector3d(across, across, mass * radius * radius / 2).asDiagonal()};
    m.links.push_back({name, inertia});
    m.colliders.push_back({.name = name,
                           .link = name,
                           .shape = Shape::capsule(radius, length),
                           .pose = at({0, 0, length / 2}),
                           .friction = 0.8});
  };
  link("upper", 0.05, 0.1), link("tip", 0.04, 0.08);
  m.joints = {joint("q1", JointKind::revolute, "base", "upper", {0, 0, 0}, {0, 1, 0}),
              joint("q2", JointKind::revolute, "upper", "tip", {0, 0, 0.1}, {0, 1, 0})};
  for (Joint& j : m.joints) j.armature = 1e-4;
  m.joints[0].drive = {.kp = 1e6, .kd = 1000.0, .position_target = 0.05};
  m.joints[0].lower = -1.5, m.joints[0].upper = limit;
  m.joints[0].position = m.joints[1].position = 0.05;
  m.couplings = {Coupling::mimic("q2", "q1", -1.0)};
  m.roots = {{"base"}};
  Collider wall{.name = "wall", .shape = Shape::half_space(), .friction = 0.8};
  wall.pose = at({0.12, 0, 0});
  wall.pose.linear() = Eigen::AngleAxisd(-std::acos(0.0), Vector3d::UnitY()).toRotationMatrix();
  m.colliders.push_back(wall);
  m.contacts = {{"wall", "tip"}};
  return m;
}

/// A finger whose joints a tendon's servo bends until its tip presses on a wall and the tendon is at its end.
inline Model finger() {
  Model model = wall();
  model.couplings.clear();
  model.joints[0].drive = {.kp = 0.02, .kd = 0.002};
  model.joints[1].lower = -1.0, model.joints[1].upper = 1.4;
  for (Joint& joint : model.joints) joint.damping = 1e-3;
  Joint tendon;
  tendon.name = "t", tendon.kind = JointKind::tendon;
  tendon.position = 0.1, tendon.lower = -3.0, tendon.upper = 1.2;
  tendon.drive = {.kp = 20.0, .kd = 0.05, .position_target = 2.0};
  tendon.effort_limit = 0.15;
  model.joints.push_back(tendon);
  model.couplings.push_back({"t", {{"q1", -1.0}, {"q2", -1.0}}, 0.0, Hard{}});
  return model;
}

/// Four legs with two servos and a knee that follows the hip, each with a round foot.
inline Model quadruped() {
  Model m;
  m.name = "quadruped";
  m.links = {{"trunk", Inertia::box(6.0, {0.4, 0.16, 0.1}, Vector3d::Zero())}};
  Root root;
  root.link = "trunk", root.floating = true, root.pose = at({0, 0, 0.371});
  m.roots = {root};
  const auto diagonal = [](double x, double y, double z) -> Eigen::Matrix3d { return Vector3d(x, y, z).asDiagonal(); };
  for (const char* leg : {"fl", "fr", "hl", "hr"}) {
    const std::string name = leg;
    const double x = name[0] == 'f' ? 0.18 : -0.18, side = name[1] == 'l' ? 1.0 : -1.0;
    m.links.push_back({name + "_abductor", {0.5, {0, 0.02 * side, 0}, diagonal(5e-4, 5e-4, 5e-4)}});
    m.links.push_back({name + "_thigh", {0.6, {0, 0, -0.1}, diagonal(3e-3, 3e-3, 5e-4)}});
    // A shank of 0.2 kg and a ball of 0.05 kg at its end, about their centre of mass.
    const double shank = 0.2, foot = 0.05, radius = 0.02, c = -(shank * 0.1 + foot * 0.2) / (shank + foot);
    const double apart = shank * std::pow(0.1 + c, 2) + foot * std::pow(0.2 + c, 2), own = 0.4 * foot * radius * radius;
    m.links.push_back(
        {name + "_shank", {shank + foot, {0, 0, c}, diagonal(1e-3 + own + apart, 1e-3 + own + apart, 1e-4 + own)}});
    m.joints.push_back(
        joint(name + "_abduction", JointKind::revolute, "trunk", name + "_abductor", {x, 0.1 * side, 0}, {1, 0, 0}));
    m.joints.push_back(
        joint(name + "_hip", JointKind::revolute, name + "_abductor", name + "_thigh", {0, 0.04 * side, 0}, {0, 1, 0}));
    m.joints.push_back(
        joint(name + "_knee", JointKind::revolute, name + "_thigh", name + "_shank", {0, 0, -0.2}, {0, 1, 0}));
    for (std::size_t j = m.joints.size() - 3; j < m.joints.size() - 1; ++j) {
      m.joints[j].drive = {.kp = 300.0, .kd = 6.0};
      m.joints[j].armature = 0.005;
    }
    m.joints[m.joints.size() - 2].position = m.joints[m.joints.size() - 2].drive.position_target = 0.5;
    m.joints.back().position = -1.0;
    m.couplings.push_back(Coupling::mimic(name + "_knee", name + "_hip", 2.0));
    m.colliders.push_back({.name = name + "_foot",
                           .link = name + "_shank",
                           .shape = Shape::sphere(radius),
                           .pose = at({0, 0, -0.2}),
                           .friction = 0.7,
                           .group = "feet"});
  }
  add_floor(m, 0.7);
  m.contacts = {{"floor", "feet"}};
  return m;
}

/// The hips' targets of a trot in place, diagonal legs in phase; legs in the order of the model.
inline Eigen::Vector4d trot(double t) {
  const double pi = 3.14159265358979323846;
  const auto lift = [&](double phase) {
    return 0.5 + (t < 0.5 ? 0.0 : 0.25 * std::max(0.0, std::sin(4 * pi * t + phase)));
  };
  return {lift(0.0), lift(pi), lift(pi), lift(0.0)};
}

}  // namespace lockstep::contact_scenes
