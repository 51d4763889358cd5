// Scalar twins: the kernels of an instruction set, one environment at a time, with the same bits.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/batch.h"

namespace lockstep::twins {

// Targets beside those of the library; including this file makes them known to it.
inline constexpr Target baseline_scalar = static_cast<Target>(100);
inline constexpr Target avx2_scalar = static_cast<Target>(101);  ///< of avx512 as well
inline constexpr Target neon_scalar = static_cast<Target>(102);

/// The one whose bits the target has. Not for Target::automatic.
inline Target twin_of(Target target) {
  return target == Target::baseline ? baseline_scalar : target == Target::neon ? neon_scalar : avx2_scalar;
}

bool add();
inline const bool added = add();

}  // namespace lockstep::twins
