// Models for the tests of the exporter, and their reports. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

#include "export/mechanism.h"
#include "lockstep/error.h"
#include "lockstep/export_model.h"
#include "lockstep/import.h"

namespace lockstep {

/// What the importer makes of exported MJCF.
inline Model read(const Export& made, const std::string& keyframe = "start") {
  return import_mjcf(made.text, "exported", {.colliders = true, .keyframe = keyframe}).model;
}

/// Hinges j0 and j1 and slide j2, side by side on a bolted base; j1 = 2 j0 + 0.1 at the start, too.
inline Model fingers() {
  Model model;
  model.name = "fingers";
  model.links.push_back({"base", {}});
  for (const char* number : {"0", "1", "2"}) {
    const std::string own = number;
    model.links.push_back({"l" + own, Inertia::box(0.2, {0.02, 0.03, 0.1}, {0.0, 0.01, 0.05})});
    Joint joint;
    joint.name = "j" + own, joint.parent = "base", joint.child = "l" + own;
    joint.kind = own == "2" ? JointKind::prismatic : JointKind::revolute;
    joint.axis = {1.0, 0.5, 0.0};
    joint.origin.translation() = Eigen::Vector3d(0.1 * static_cast<double>(own[0] - '0'), 0.02, 0.3);
    joint.origin.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    model.joints.push_back(joint);
  }
  model.couplings.push_back(Coupling::mimic("j1", "j0", -2.0, -0.1));
  model.joints[1].position = 0.1;
  return model;
}

/// An arm with two joints at its end, between which are only a link and a frame fixed to it.
inline Model wrist() {
  Model model;
  model.links = {{"world", {}},
                 {"arm", Inertia::box(1.0, {0.05, 0.05, 0.3}, {0.0, 0.0, 0.15})},
                 {"roll", {}},
                 {"frame", {}},
                 {"hand", Inertia::box(0.4, {0.05, 0.1, 0.1}, {0.02, 0.0, 0.05})}};
  const char* names[] = {"shoulder", "roll", "fixed", "pitch"};
  for (std::size_t j = 0; j < 4; ++j) {
    Joint joint;
    joint.name = names[j];
    joint.parent = model.links[j].name, joint.child = model.links[j + 1].name;
    joint.kind = j == 2 ? JointKind::fixed : JointKind::continuous;
    joint.axis = j == 3 ? Eigen::Vector3d(0.0, 1.0, 0.3) : Eigen::Vector3d(0.2, 0.0, 1.0);
    joint.origin.translation() = Eigen::Vector3d(0.03, 0.01, 0.1);
    joint.origin.linear() = Eigen::AngleAxisd(0.5, Eigen::Vector3d(3, 2, 1).normalized()).toRotationMatrix();
    model.joints.push_back(joint);
  }
  return model;
}

inline std::string report_of(const Export& made) {
  std::string text;
  for (const std::string& line : made.report) text += line + "\n";
  return text;
}
inline bool reports(const Export& made, const std::string& part) {
  return report_of(made).find(part) != std::string::npos;
}
inline bool warns(const Export& made, const std::string& part) {
  return std::any_of(made.warnings.begin(), made.warnings.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

/// All values of an attribute of three numbers.
inline std::vector<Eigen::Vector3d> triples_of(const std::string& text, const std::string& attribute) {
  std::vector<Eigen::Vector3d> found;
  const std::regex pattern(" " + attribute + "=\"(\\S+) (\\S+) (\\S+)\"");
  for (auto at = std::sregex_iterator(text.begin(), text.end(), pattern); at != std::sregex_iterator(); ++at)
    found.emplace_back(std::stod(at->str(1)), std::stod(at->str(2)), std::stod(at->str(3)));
  return found;
}

}  // namespace lockstep
