// Collects the generated kernels of the stability tests and checks their use. SPDX-License-Identifier: Apache-2.0
//
// See tests/generated/stability.cmake.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "lockstep/batch.h"
#include "lockstep/generate.h"

namespace lockstep::stability {

/// One thread.
inline BatchOptions options() { return {.threads = 1}; }

inline std::string kernel_file(const char* folder, const Plan& plan) {
  return fmt::format("{}/k{:016x}.cpp", folder, kernel_hash(plan));
}

/// Returns the plan. If the environment variable LOCKSTEP_COLLECT_KERNELS names a folder, writes the kernel of the plan
/// there first.
inline const Plan& collected(const Plan& plan) {
  const char* folder = std::getenv("LOCKSTEP_COLLECT_KERNELS");
  if (!folder || kernel_hash(plan) == 0) return plan;
  const std::filesystem::path file = kernel_file(folder, plan);
  if (!std::filesystem::exists(file)) std::ofstream(file) << generate_kernel(plan, {.name = file.stem().string()}).code;
  return plan;
}

/// If LOCKSTEP_EXPECT_KERNELS names that folder and it has the kernel of the batch's plan, expects the batch to use it.
template <class S>
void expect_kernel(const Batch<S>& batch) {
  const char* folder = std::getenv("LOCKSTEP_EXPECT_KERNELS");
  if (!folder || !std::filesystem::exists(kernel_file(folder, batch.plan()))) return;
  EXPECT_EQ(batch.engine(), Engine::generated);
}

}  // namespace lockstep::stability
