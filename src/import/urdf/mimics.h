// From URDF's mimic elements to couplings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "import/report.h"
#include "lockstep/model.h"

namespace lockstep::importer::urdf {

/// q_follower = multiplier * q_leader + offset, as in the file.
struct Mimic {
  std::size_t follower;  ///< index in Model::joints
  std::string leader;
  double multiplier = 1.0;
  double offset = 0.0;
};

/// Adds one Coupling for each mimic, in order. Its leader is an independent joint. Followers start where their
/// couplings hold. Throws ModelError if a mimic is impossible.
void couple_mimics(const std::vector<Mimic>& mimics, Model& model, Report& report);

}  // namespace lockstep::importer::urdf
