// Runs of the suite on generated kernels (tests/generated/stability.cmake). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "lockstep/batch.h"
#include "lockstep/generate.h"

namespace lockstep::stability {

/// On one thread.
inline BatchOptions options() { return {.threads = 1}; }

inline std::string kernel_file(const char* folder, const Plan& plan) {
  return fmt::format("{}/k{:016x}.cpp", folder, kernel_hash(plan));
}

/// With LOCKSTEP_COLLECT_KERNELS naming a folder, writes the plan's kernel there.
inline const Plan& noted(const Plan& plan) {
  const char* folder = std::getenv("LOCKSTEP_COLLECT_KERNELS");
  if (!folder || kernel_hash(plan) == 0) return plan;
  const std::filesystem::path file = kernel_file(folder, plan);
  if (!std::filesystem::exists(file)) std::ofstream(file) << generate_kernel(plan, {.name = file.stem().string()}).code;
  return plan;
}

/// With LOCKSTEP_EXPECT_KERNELS naming that folder, a batch that is stepped otherwise although a kernel was written for
/// it is a failure.
template <class S>
void expect_kernel(const Batch<S>& batch) {
  const char* folder = std::getenv("LOCKSTEP_EXPECT_KERNELS");
  if (!folder || !std::filesystem::exists(kernel_file(folder, batch.plan()))) return;
  EXPECT_EQ(batch.engine(), Engine::generated);
}

}  // namespace lockstep::stability
