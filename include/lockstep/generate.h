// Generated kernels: the step of one plan as straight-line C++. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "lockstep/batch.h"

namespace lockstep {

struct KernelOptions {
  /// Of the kernel, in reports and for the linker: unique in a program. The model's name if empty; characters that a
  /// C++ name cannot have become _.
  std::string name;
  bool f32 = true, f64 = true;  ///< for Batch<float>, for Batch<double>; at least one of them
};

struct KernelSource {
  std::string code;    ///< a whole C++ file; lockstep_add_kernel() of the CMake package compiles and links it
  std::uint64_t hash;  ///< of the step: a Batch finds the kernel by it
  long operations;     ///< of one step on registers, a multiply-add is one; sweeps counted once
  long flops;          ///< of one step, a multiply-add is two; all sweeps
};

/// Writes the code of the plan's step. Inputs and declared per-environment fields stay variable; everything else is
/// written in as a number, and what a number makes superfluous (an offset of 0, an identity rotation) is left out.
/// Where bounds act or a servo is at its limit, the code calls the library. Throws SettingsError if no precision is
/// asked for, and for plans of which no kernel can be generated: Plan::describe() tells. Thread-safe.
LOCKSTEP_API KernelSource generate_kernel(const Plan& plan, const KernelOptions& options = {});

/// The hash that generate_kernel() would give, 0 where it would throw. Two plans with the same hash share the same
/// code; they may differ in the numbers of their bounds, which the code reads from the plan. Thread-safe.
LOCKSTEP_API std::uint64_t kernel_hash(const Plan& plan);

/// How many generated kernels have registered themselves in this program, for whatever plans. Thread-safe.
LOCKSTEP_API int registered_kernels();

/// The machine code that Engine::compiled runs for the plan: an instruction a line, with the name of the number that it
/// makes. For people. `scalar_bytes` is 4 for Batch<float>, 8 for Batch<double>. Throws SettingsError for plans and
/// targets that have none. Thread-safe.
LOCKSTEP_API std::string machine_code(const Plan& plan, Target target = Target::automatic, int scalar_bytes = 4);

}  // namespace lockstep
