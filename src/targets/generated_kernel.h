// A generated kernel, and how the library comes to know of it. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/state_pointers.h"
#include "plan/tables.h"

namespace lockstep {

template <class S>
using Advance = void (*)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t, std::ptrdiff_t, int, void*);

/// A step in straight-line code, for one plan and one instruction set.
struct GeneratedKernel {
  const char* name;
  const char* version;  ///< of the library that wrote it; another one does not use it
  const char* target;   ///< to_string(Target)
  std::uint64_t hash;   ///< kernel_hash() of the plan
  Advance<float> f32;   ///< null where it was not asked for
  Advance<double> f64;
  int tiles_per_call;  ///< tiles that it steps in turn, part by part: it needs scratch memory for so many
  int carried_values;  ///< and for so many numbers of each, a mask being one
};

/// Before main() or later. The kernel must live as long as the program. Thread-safe.
LOCKSTEP_API void register_kernel(const GeneratedKernel& kernel);

/// Registers kernels before main(), as a constant somewhere. Not from a file with special instructions: the machine may
/// lack them.
struct RegisterKernels {
  template <class... Kernels>
  explicit RegisterKernels(const Kernels&... kernels) {
    (register_kernel(kernels), ...);
  }
};

}  // namespace lockstep
