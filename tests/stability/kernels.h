// The suite's plans, for a run of it on generated kernels: tests/generated/stability.cmake. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "lockstep/batch.h"
#include "lockstep/generate.h"

namespace lockstep::stability {

/// With LOCKSTEP_COLLECT_KERNELS naming a folder, writes the plan's kernel there.
inline const Plan& noted(const Plan& plan) {
  const char* folder = std::getenv("LOCKSTEP_COLLECT_KERNELS");
  if (!folder || kernel_hash(plan) == 0) return plan;
  const std::string name = fmt::format("k{:016x}", kernel_hash(plan));
  const std::filesystem::path file = std::filesystem::path(folder) / (name + ".cpp");
  if (!std::filesystem::exists(file)) std::ofstream(file) << generate_kernel(plan, {.name = name}).code;
  return plan;
}

/// With LOCKSTEP_EXPECT_KERNELS set, a batch that is stepped by the tables is a failure.
template <class S>
void expect_kernel(const Batch<S>& batch) {
  if (!std::getenv("LOCKSTEP_EXPECT_KERNELS") || kernel_hash(batch.plan()) == 0) return;
  EXPECT_NE(batch.kernel(), "tables");
}

}  // namespace lockstep::stability
