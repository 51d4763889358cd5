// Which couplings fit. SPDX-License-Identifier: Apache-2.0
#include "mimics.h"

#include "model/softness_numbers.h"

namespace lockstep::exporter::urdf {

Mimics mimics_of(const Model& model, Report& report) {
  Mimics mimics;
  const auto follows = [&](std::string joint, const std::string& leader) {
    for (auto at = mimics.find(joint); at != mimics.end(); at = mimics.find(joint))
      joint = at->second->terms.front().joint;
    return joint == leader;
  };
  const std::vector<std::string> names = coupling_names(model);
  for (std::size_t c = 0; c < names.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    if (coupling.terms.size() > 1) {
      report.warn("couplings of more than two joints, left out", names[c]);
    } else if (coupling.function) {
      report.warn("followers by a function, left out", names[c]);
    } else if (mimics.contains(coupling.joint)) {
      report.warn("second couplings of a joint, left out", names[c]);
    } else if (follows(coupling.terms.front().joint, coupling.joint)) {
      report.warn("couplings that close a circle of mimics, left out", names[c]);
    } else {
      mimics.emplace(coupling.joint, &coupling);
      if (!is_hard(coupling.softness))
        report.warn("softness of couplings, left out: mimics are hard", names[c]);
      else if (erp_of(coupling.softness) != Hard().erp)
        report.remark("shares of an error that a step corrects (erp), left out", names[c]);
      if (coupling.force_limit < infinity) report.warn("force limits of couplings, left out", names[c]);
    }
  }
  return mimics;
}

double start_of(const std::string& joint, const Mimics& mimics) {
  const auto mimic = mimics.find(joint);
  if (mimic == mimics.end()) return 0.0;
  const CouplingTerm& term = mimic->second->terms.front();
  return -term.ratio * start_of(term.joint, mimics) - mimic->second->offset;
}

}  // namespace lockstep::exporter::urdf
