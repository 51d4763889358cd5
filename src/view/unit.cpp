// SPDX-License-Identifier: Apache-2.0
#include "unit.h"

#include <algorithm>

namespace lockstep::view {

std::string unit_of(const Model& model, const std::string& joint) {
  return unit_of(model, model.joints[static_cast<std::size_t>(model.joint_index(joint))]);
}

std::string unit_of(const Model& model, const Joint& own) {
  if (!own.path.empty()) return "m";
  if (own.kind != JointKind::tendon) return own.kind == JointKind::prismatic ? "m" : "rad";
  const auto coupling = std::find_if(model.couplings.begin(), model.couplings.end(),
                                     [&](const Coupling& candidate) { return candidate.joint == own.name; });
  return unit_of(model, coupling->terms.front().joint);
}

}  // namespace lockstep::view
