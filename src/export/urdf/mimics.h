// Couplings as mimics. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unordered_map>

#include "export/export.h"

namespace lockstep::exporter::urdf {

/// By follower: the coupling that its <mimic> says. A joint has one of them, and they form no circle.
using Mimics = std::unordered_map<std::string, const Coupling*>;
Mimics mimics_of(const Model& model, Report& report);

/// Where readers start a joint: at 0, and followers where that puts them.
double start_of(const std::string& joint, const Mimics& mimics);

}  // namespace lockstep::exporter::urdf
