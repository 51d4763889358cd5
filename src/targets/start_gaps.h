// Gaps of colliders at given positions, for the words about a plan: one tile of the baseline's kernels.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "plan/tables.h"

namespace lockstep {

/// The least gap of each pair, m, at rest at positions q by joint, and floating roots at poses of seven numbers each.
/// A pair that is far is at unlimited. `scratch` is that of reduced_matrix().
void start_gaps(const Tables<float>& t, const float* q, const float* root_poses, float* gaps, void* scratch);

}  // namespace lockstep
