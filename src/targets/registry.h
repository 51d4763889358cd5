// The generated kernels in this program. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "generated_kernel.h"
#include "lockstep/batch.h"
#include "lockstep/generate.h"

namespace lockstep {

/// All kernels for the plan with this hash that this version of the library wrote.
std::vector<const GeneratedKernel*> find_kernels(std::uint64_t hash);

/// A kernel's step in precision S, null if it has none.
template <class S>
Advance<S> advance_of(const GeneratedKernel& kernel) {
  if constexpr (sizeof(S) == 4)
    return kernel.f32;
  else
    return kernel.f64;
}

/// The first of them for the target that has a step in precision S; each precision may have its own. Null if none has.
template <class S>
const GeneratedKernel* find_kernel(std::uint64_t hash, Target target) {
  for (const GeneratedKernel* kernel : find_kernels(hash))
    if (kernel->target == std::string(to_string(target)) && advance_of<S>(*kernel)) return kernel;
  return nullptr;
}

}  // namespace lockstep
