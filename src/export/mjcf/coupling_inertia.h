// The inertia that couplings move. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/model.h"

namespace lockstep::exporter::mjcf {

/// By coupling: 1 / r of (M28) at the model's start, kg m^2 or kg along its first joint, where all joints are free.
/// 0 for those of tendons.
std::vector<double> coupling_inertias(const Model& model);

}  // namespace lockstep::exporter::mjcf
