// Tendons of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep {

/// The tendon whose position the coupling says; null if it is no tendon's.
const Joint* tendon_of(const Coupling& coupling, const Model& model);

/// Whether the joint's soft range is a tendon's spring, which has no force within it: no bound that could be ignored.
bool has_slack_spring(const Joint& joint);

/// Puts the start of each tendon where its joints have it.
void place_tendons(Model& model);

}  // namespace lockstep
