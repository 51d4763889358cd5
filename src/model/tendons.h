// Tendons of a Model. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep {

/// Puts the start of each tendon where its joints have it.
void place_tendons(Model& model);

}  // namespace lockstep
