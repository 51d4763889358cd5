// The plans that kernels are generated for, so that tests can run them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "lockstep/lockstep.h"

namespace lockstep::generated {

/// Named SCENE_METHOD or random_SEED, with `_fields` behind where all parameters differ per environment and `_bounds`
/// where everything is bounded. Impulses are recorded wherever fields differ, diagnostics wherever bounds are.
Plan plan_of(const std::string& name);

}  // namespace lockstep::generated
