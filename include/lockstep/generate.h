// Straight-line kernels: the step of one plan as a C++ file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "lockstep/plan.h"

namespace lockstep {

struct KernelOptions {
  std::string name;  ///< of the kernel, in reports and for the linker: unlike all others of a program. The model's if
                     ///< empty; what may not stand in a C++ name becomes _
  bool f32 = true, f64 = true;  ///< for Batch<float>, for Batch<double>; one of them at least
};

struct KernelSource {
  std::string code;     ///< a whole C++ file; lockstep_add_kernel() of the CMake package compiles and links it
  std::uint64_t hash;   ///< of the step: a Batch finds the kernel by it
  long operations;      ///< of one step on registers, a multiply-add is one; sweeps counted once
  long flops;           ///< of one step, a multiply-add is two; all sweeps
};

/// Writes the code: what the tables make the kernels do for this plan, without the tables, less what comes out as
/// nothing (offsets of 0, rotations by nothing). Searches among bounds and servos at their limit stay the tables' code,
/// called from in between. Inputs, and all that was declared to differ per environment, stay variable; everything else
/// is written in as a number.
/// Throws SettingsError for `tgs` with a softness per environment, which is worked out lane by lane, and if no
/// precision is asked for. Thread-safe.
KernelSource generate_kernel(const Plan& plan, const KernelOptions& options = {});

/// The hash that generate_kernel() would give, 0 where it would throw. Two plans with the same hash are
/// served by the same code; numbers of bounds may differ, which code that is called reads from the plan.
std::uint64_t kernel_hash(const Plan& plan);

}  // namespace lockstep
