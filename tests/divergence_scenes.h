// Scenes in which no two environments do the same: a quadruped with limits that may bump into itself, and a hand with a
// cube in it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "contact_scenes.h"

namespace lockstep::contact_scenes {

/// The quadruped with ranges, dry friction and effort limits. With `bumps`, trunk, thighs and shanks touch the floor
/// and those of other legs, too: 75 pairs.
inline Model limited_quadruped(bool bumps) {
  Model m = quadruped();
  for (Joint& joint : m.joints) {
    if (joint.drive.kp == 0.0) {
      joint.lower = -2.6, joint.upper = 0.0;
      continue;
    }
    joint.lower = joint.position - 0.9, joint.upper = joint.position + 0.9;
    joint.friction = 0.2, joint.effort_limit = 25.0;
  }
  if (!bumps) return m;
  m.colliders.push_back({.name = "trunk", .link = "trunk", .shape = Shape::box({0.4, 0.16, 0.1}), .friction = 0.5});
  const char* const legs[] = {"fl", "fr", "hl", "hr"};
  const auto add_capsule = [&](const std::string& link, double radius, double length, double z) {
    m.colliders.push_back(
        {.name = link, .link = link, .shape = Shape::capsule(radius, length), .pose = at({0, 0, z}), .friction = 0.5});
    m.contacts.push_back({"floor", link});
  };
  m.contacts.push_back({"floor", "trunk"});
  for (const std::string leg : legs) {
    add_capsule(leg + "_thigh", 0.025, 0.12, -0.1);
    add_capsule(leg + "_shank", 0.015, 0.1, -0.08);
    for (const char* part : {"_shank", "_foot"}) m.contacts.push_back({"trunk", leg + part});
  }
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < a; ++b)
      for (const char* part : {"_thigh", "_shank", "_foot"})
        for (const char* other : {"_thigh", "_shank", "_foot"})
          m.contacts.push_back({std::string(legs[a]) + part, std::string(legs[b]) + other});
  return m;
}

/// A palm with four fingers of three links, whose last joints follow the middle ones, and a cube of 0.1 kg on it.
/// Fingers touch the cube, each other and the palm: 71 pairs.
inline Model hand_with_cube() {
  Model m;
  m.name = "hand";
  m.links = {{"palm", Inertia::box(1.0, {0.1, 0.1, 0.03}, Vector3d::Zero())}};
  m.roots = {{"palm"}};
  m.colliders.push_back({.name = "palm", .link = "palm", .shape = Shape::box({0.1, 0.1, 0.03}), .friction = 0.8});
  add_block(m, "cube", 0.1, {0.05, 0.05, 0.05}, {0, 0, 0.045}, 0.8);
  m.contacts.push_back({"palm", "cube"});
  const Vector3d places[] = {{0.035, -0.035, 0.02}, {0.035, 0, 0.02}, {0.035, 0.035, 0.02}, {-0.045, 0, 0.02}};
  const double lengths[] = {0.045, 0.03, 0.025};
  const Drive servo{.kp = 2.0, .kd = 0.05};
  for (int finger = 0; finger < 4; ++finger) {
    const std::string name = "finger" + std::to_string(finger);
    const double inwards = places[finger].x() > 0.0 ? -1.0 : 1.0;
    const auto add = [&](const std::string& own, const std::string& parent, const Vector3d& place, const Vector3d& axis,
                         double lower, double upper) -> Joint& {
      Joint j = joint(own, JointKind::revolute, parent, own, place, axis);
      j.lower = lower, j.upper = upper, j.armature = 5e-4;
      m.joints.push_back(j);
      return m.joints.back();
    };
    const auto drive = [&](Joint& j) { j.drive = servo, j.friction = 0.01, j.effort_limit = 0.8; };
    m.links.push_back({name + "_spread", Inertia::box(0.02, {0.02, 0.02, 0.02}, Vector3d::Zero())});
    drive(add(name + "_spread", "palm", places[finger], Vector3d::UnitZ(), -0.3, 0.3));
    std::string parent = name + "_spread";
    Vector3d place(0, 0, 0.01);
    for (int s = 0; s < 3; ++s) {
      const std::string link = name + "_" + std::to_string(s);
      m.links.push_back({link, Inertia::box(0.03, {0.015, 0.015, lengths[s]}, {0, 0, lengths[s] / 2})});
      Joint& j = add(link, parent, place, inwards * Vector3d::UnitY(), s < 2 ? -0.2 : -2.0, s < 2 ? 1.7 : 2.0);
      j.position = s < 2 ? 0.3 : 0.24;
      if (s < 2) drive(j), j.drive.position_target = 0.3;
      m.colliders.push_back({.name = link,
                             .link = link,
                             .shape = Shape::capsule(0.008, 0.7 * lengths[s]),
                             .pose = at({0, 0, lengths[s] / 2}),
                             .friction = 0.8});
      m.contacts.push_back({link, "cube"});
      parent = link, place = {0, 0, lengths[s]};
    }
    m.couplings.push_back(Coupling::mimic(name + "_2", name + "_1", 0.8));
    m.contacts.push_back({"palm", name + "_2"});
    for (int other = 0; other < finger; ++other)
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
          m.contacts.push_back(
              {name + "_" + std::to_string(a), "finger" + std::to_string(other) + "_" + std::to_string(b)});
  }
  return m;
}

}  // namespace lockstep::contact_scenes
