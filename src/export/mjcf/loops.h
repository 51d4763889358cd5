// Loops as points that meet, and as welds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep::exporter::mjcf {

/// Two sites that a <connect> holds together.
struct HeldPoint {
  std::string name, first, second;
};

/// The points that the points and hinges among the loops hold. Adds the sites that the model lacks; the link of those
/// in the world is empty.
std::vector<HeldPoint> add_sites_of_loops(Model& model);

}  // namespace lockstep::exporter::mjcf
