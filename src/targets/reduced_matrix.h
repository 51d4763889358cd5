// A_r at given positions, for compile(): one tile of the baseline's kernels. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "plan/tables.h"

namespace lockstep {

/// Bytes of scratch memory that reduced_matrix() needs, zeroed and aligned as std::max_align_t is.
std::size_t reduced_matrix_bytes(const Tables<float>& t);

/// A_r, or A itself where no follower is eliminated, packed as t.solver says, at positions q. `joint_inertia` is added
/// to the diagonal of A. Both are by joint. Not for articulated bodies.
void reduced_matrix(const Tables<float>& t, const float* q, const float* joint_inertia, float* packed, void* scratch);

}  // namespace lockstep
