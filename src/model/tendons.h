// Tendons of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep {

/// Whether the joint's soft range is a tendon's spring, which has no force within it: no bound that could be ignored.
bool has_slack_spring(const Joint& joint);

/// Puts the start of each tendon where its joints have it.
void place_tendons(Model& model);

}  // namespace lockstep
