// Which attributes of an MJCF file have no effect. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "lockstep/error.h"
#include "unit/import_helpers.h"

namespace lockstep {

/// All of a Model, for comparisons.
inline std::string text_of(const Model& model) {
  std::ostringstream out;
  out.precision(17);
  const auto softness = [&](const Softness& of) {
    out << of.index() << ' ';
    std::visit([&](const auto& s) { out.write(reinterpret_cast<const char*>(&s), sizeof s); }, of);
  };
  for (const Link& link : model.links)
    out << link.name << ' ' << link.inertia.mass << ' ' << link.inertia.center.transpose() << ' '
        << link.inertia.about_center << ' ' << link.gravity << '\n';
  for (const Joint& j : model.joints) {
    out << j.name << ' ' << static_cast<int>(j.kind) << ' ' << j.parent << ' ' << j.child << ' ' << j.origin.matrix()
        << ' ' << j.axis.transpose() << ' ';
    for (const double number : {j.damping, j.armature, j.stiffness, j.rest, j.drive.kp, j.drive.kd,
                                j.drive.position_target, j.drive.velocity_target, j.effort, j.lower, j.upper,
                                j.restitution, j.velocity_limit, j.effort_limit, j.friction, j.position, j.velocity})
      out << number << ' ';
    for (const TendonSegment& s : j.path)
      out << s.first << ' ' << s.second << ' ' << s.first_point.transpose() << ' ' << s.second_point.transpose() << ' '
          << s.share << ' ';
    softness(j.limit_softness);
    out << '\n';
  }
  for (const Coupling& coupling : model.couplings) {
    out << coupling.joint << ' ' << coupling.offset << ' ';
    for (const CouplingTerm& term : coupling.terms) out << term.joint << ' ' << term.ratio << ' ';
    if (coupling.function)
      for (const double c : std::get<Polynomial>(*coupling.function).coefficients) out << c << ' ';
    softness(coupling.softness);
    out << '\n';
  }
  for (const Loop& loop : model.loops) {
    out << loop.name << ' ' << to_string(loop.kind) << ' ' << loop.first << ' ' << loop.second << ' '
        << loop.first_pose.matrix() << ' ' << loop.second_pose.matrix() << ' ';
    softness(loop.softness);
    out << '\n';
  }
  for (const Site& site : model.sites) out << site.name << ' ' << site.link << ' ' << site.pose.matrix() << '\n';
  for (const Collider& c : model.colliders) {
    out << c.name << ' ' << c.link << ' ' << static_cast<int>(c.shape.kind) << ' ' << c.shape.size.transpose() << ' '
        << c.pose.matrix() << ' ' << c.friction << ' ' << c.torsional_friction << ' ' << c.rolling_friction << ' ';
    softness(c.softness);
    out << '\n';
  }
  for (const Contact& c : model.contacts) {
    out << c.first << ' ' << c.second << ' ' << c.friction.value_or(-1.0) << ' ' << c.torsional_friction.value_or(-1.0)
        << ' ' << c.rolling_friction.value_or(-1.0) << ' ';
    if (c.softness) softness(*c.softness);
    out << '\n';
  }
  for (const Root& root : model.roots)
    out << root.link << ' ' << root.floating << ' ' << root.pose.matrix() << ' ' << root.velocity.transpose() << '\n';
  for (const NamedPose& pose : model.poses) {
    out << pose.name;
    for (const auto* numbers :
         {&pose.positions, &pose.velocities, &pose.position_targets, &pose.velocity_targets, &pose.efforts})
      for (const auto& [name, number] : *numbers) out << ' ' << name << ' ' << number;
    for (const auto& [link, at] : pose.root_poses) out << ' ' << link << ' ' << at.matrix();
    for (const auto& [link, twist] : pose.root_velocities) out << ' ' << link << ' ' << twist.transpose();
    out << '\n';
  }
  out << model.name << ' ' << model.gravity.transpose() << ' ' << model.time_step;
  return out.str();
}

inline std::string contents(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// What is read: the Model and the report, or the error.
inline std::string read(const std::string& text, const ImportOptions& options) {
  try {
    const Import import = import_mjcf(text, "file", options);
    return text_of(import.model) + report_of(import);
  } catch (const Error& error) {
    return error.what();
  }
}

/// 'tag: attribute="value"' of all attributes whose deletion changes nothing.
inline std::set<std::string> without_effect(const std::string& text, const ImportOptions& options) {
  std::set<std::string> found;
  const std::string whole = read(text, options);
  std::string bare = text;  // without comments, but with their lines
  for (std::size_t at; (at = bare.find("<!--")) != std::string::npos;)
    for (const std::size_t end = bare.find("-->", at) + 3; at < end; ++at)
      if (bare[at] != '\n') bare[at] = ' ';
  EXPECT_EQ(read(bare, options), whole);
  const std::regex attribute("\\s([A-Za-z_0-9]+)\\s*=\\s*(\"[^\"]*\"|'[^']*')");
  for (auto at = std::sregex_iterator(bare.begin(), bare.end(), attribute); at != std::sregex_iterator(); ++at) {
    const auto position = static_cast<std::size_t>(at->position()), length = static_cast<std::size_t>(at->length());
    std::string less = bare;
    less.erase(position, length);
    if (read(less, options) != whole) continue;
    const std::size_t open = bare.rfind('<', position);
    found.insert(bare.substr(open + 1, bare.find_first_of(" \t\n", open) - open - 1) + ": " + at->str(1) + "=" +
                 at->str(2));
  }
  return found;
}

}  // namespace lockstep
