// Units of joints. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "lockstep/model.h"

namespace lockstep::view {

/// Of a joint's position: "m" or "rad". A tendon has the unit of its first joint.
std::string unit_of(const Model& model, const std::string& joint);
std::string unit_of(const Model& model, const Joint& joint);

}  // namespace lockstep::view
