// Loops as points that meet, and as welds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "export/export.h"
#include "lockstep/model.h"

namespace lockstep::exporter::mjcf {

/// Two sites that a <connect> holds together.
struct HeldPoint {
  std::string name, first, second;
};

/// The points that the points and hinges among the loops hold. Adds the sites that the model lacks; the link of those
/// in the world is empty. Renames loops that have the name of a coupling: MuJoCo has one set of names for both.
std::vector<HeldPoint> add_sites_of_loops(Model& model, Report& report);

}  // namespace lockstep::exporter::mjcf
