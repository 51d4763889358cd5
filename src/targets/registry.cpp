// SPDX-License-Identifier: Apache-2.0
#include "registry.h"

#include <mutex>

#include "lockstep/version.h"

namespace lockstep {
namespace {

struct Registry {
  std::mutex mutex;
  std::vector<const GeneratedKernel*> kernels;
};

// Created by the first caller, because kernels register themselves before main().
Registry& registry() {
  static Registry all;
  return all;
}

}  // namespace

void register_kernel(const GeneratedKernel& kernel) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  all.kernels.push_back(&kernel);
}

int registered_kernels() {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  return static_cast<int>(all.kernels.size());
}

std::vector<const GeneratedKernel*> find_kernels(std::uint64_t hash) {
  Registry& all = registry();
  const std::lock_guard lock(all.mutex);
  std::vector<const GeneratedKernel*> found;
  for (const GeneratedKernel* kernel : all.kernels)
    if (kernel->hash == hash && std::string(kernel->version) == version()) found.push_back(kernel);
  return found;
}

}  // namespace lockstep
