// The generated kernels that this program holds. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "generated_kernel.h"
#include "lockstep/batch.h"

namespace lockstep {

/// Whether there are any: only then is a plan's hash worth finding out.
bool any_kernel_registered();

/// The kernel for the plan with this hash, written by this version of the library; null if there is none.
const GeneratedKernel* find_kernel(std::uint64_t hash, Target target);

/// All of them with this hash, for reports.
std::vector<const GeneratedKernel*> find_kernels(std::uint64_t hash);

}  // namespace lockstep
