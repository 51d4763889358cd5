// All of a Model as text, for comparisons. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sstream>
#include <string>

#include "lockstep/model.h"

namespace lockstep {

inline std::string text_of(const Model& model) {
  std::ostringstream out;
  out.precision(17);
  const auto softness = [&](const Softness& of) {
    out << of.index() << ' ';
    std::visit([&](const auto& s) { out.write(reinterpret_cast<const char*>(&s), sizeof s); }, of);
  };
  for (const Link& link : model.links)
    out << link.name << ' ' << link.inertia.mass << ' ' << link.inertia.center.transpose() << ' '
        << link.inertia.about_center << '\n';
  for (const Joint& j : model.joints) {
    out << j.name << ' ' << static_cast<int>(j.kind) << ' ' << j.parent << ' ' << j.child << ' ' << j.origin.matrix()
        << ' ' << j.axis.transpose() << ' ';
    for (const double number : {j.damping, j.armature, j.stiffness, j.rest, j.drive.kp, j.drive.kd,
                                j.drive.position_target, j.drive.velocity_target, j.effort, j.lower, j.upper,
                                j.restitution, j.velocity_limit, j.effort_limit, j.friction, j.position, j.velocity})
      out << number << ' ';
    softness(j.limit_softness);
    out << '\n';
  }
  for (const Coupling& coupling : model.couplings) {
    out << coupling.joint << ' ' << coupling.offset << ' ';
    for (const CouplingTerm& term : coupling.terms) out << term.joint << ' ' << term.ratio << ' ';
    softness(coupling.softness);
    out << '\n';
  }
  for (const Site& site : model.sites) out << site.name << ' ' << site.link << ' ' << site.pose.matrix() << '\n';
  for (const Collider& c : model.colliders)
    out << c.name << ' ' << c.link << ' ' << static_cast<int>(c.shape.kind) << ' ' << c.shape.size.transpose() << ' '
        << c.pose.matrix() << ' ' << c.friction << '\n';
  for (const Contact& c : model.contacts) out << c.first << ' ' << c.second << ' ' << c.friction.value_or(-1.0) << '\n';
  for (const Root& root : model.roots)
    out << root.link << ' ' << root.floating << ' ' << root.pose.matrix() << ' ' << root.velocity.transpose() << '\n';
  out << model.name << ' ' << model.gravity.transpose();
  return out.str();
}

}  // namespace lockstep
