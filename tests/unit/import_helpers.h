// Small helpers of the importer's tests. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "lockstep/import.h"

namespace lockstep {

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
      << "no line: " << line << "\nbut:\n" << report_of(import);
}

/// C of a coupling with one term at the model's starting positions.
inline double error_at_start(const Model& model, const Coupling& coupling) {
  return joint(model, coupling.joint).position + coupling.terms[0].ratio * joint(model, coupling.terms[0].joint).position +
         coupling.offset;
}

}  // namespace lockstep
