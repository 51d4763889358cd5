// Helpers that the tests of the importer share. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "lockstep/import.h"

namespace lockstep {

/// An inertial with 1 kg and moments of 1 kg m^2.
inline const std::string unit_body =
    "<inertial><mass value='1'/><inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial>";

inline Import model_file(const std::string& name) {
  return import_urdf_file(std::string(LOCKSTEP_MODELS) + "/" + name + ".urdf");
}

inline const Joint& joint(const Model& model, const std::string& name) { return model.joints[model.joint_index(name)]; }
inline const Link& link(const Model& model, const std::string& name) { return model.links[model.link_index(name)]; }

inline std::string report_of(const Import& import) {
  std::string text;
  for (const std::string& line : import.report) text += line + "\n";
  return text;
}

inline void expect_reports(const Import& import, const std::string& line) {
  EXPECT_NE(std::find(import.report.begin(), import.report.end(), line), import.report.end())
      << "the report lacks the line: " << line << "\nIt is:\n"
      << report_of(import);
}

inline bool warns(const Import& import, const std::string& part) {
  return std::any_of(import.warnings.begin(), import.warnings.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

/// C at the model's start, for a coupling with one term.
inline double error_at_start(const Model& model, const Coupling& coupling) {
  const CouplingTerm& term = coupling.terms[0];
  return joint(model, coupling.joint).position + term.ratio * joint(model, term.joint).position + coupling.offset;
}

}  // namespace lockstep
