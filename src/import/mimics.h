// From URDF's mimic elements to couplings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"
#include "report.h"

namespace lockstep::urdf {

/// q_follower = multiplier * q_leader + offset, as the file has it.
struct Mimic {
  std::size_t follower;  ///< index in Model::joints
  std::string leader;
  double multiplier = 1.0;
  double offset = 0.0;
};

/// Adds one Coupling per mimic, in order, each with a joint that is nobody's follower, and starts the
/// followers where their couplings hold. Throws ModelError for mimics that can follow nothing.
void couple_mimics(const std::vector<Mimic>& mimics, Model& model, Report& report);

}  // namespace lockstep::urdf
