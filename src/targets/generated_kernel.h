// A generated kernel, and its registration with the library. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/state_pointers.h"
#include "plan/tables.h"

namespace lockstep {

template <class S>
using Advance = void (*)(const Tables<S>&, const StatePointers<S>&, std::ptrdiff_t, std::ptrdiff_t, int, void*);

/// A step in straight-line code, for one plan and one instruction set.
struct GeneratedKernel {
  const char* name;
  const char* version;  ///< of the library that wrote it; other versions do not use it
  const char* target;   ///< to_string(Target)
  std::uint64_t hash;   ///< kernel_hash() of the plan
  Advance<float> f32;   ///< null if the kernel has no single precision
  Advance<double> f64;
  int tiles_per_call;  ///< tiles that it steps in turn, part by part; scratch memory has room for them
  int carried_values;  ///< numbers or masks of each tile that go from part to part, in scratch memory
};

/// Registers a kernel, before main() or later. The kernel must live as long as the program. Thread-safe.
LOCKSTEP_API void register_kernel(const GeneratedKernel& kernel);

/// A constant of this type registers kernels before main(). Do not define it in a file that is compiled for special
/// instructions: the machine may lack them.
struct RegisterKernels {
  template <class... Kernels>
  explicit RegisterKernels(const Kernels&... kernels) {
    (register_kernel(kernels), ...);
  }
};

}  // namespace lockstep
