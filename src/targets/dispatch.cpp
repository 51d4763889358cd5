// SPDX-License-Identifier: Apache-2.0
#include "dispatch.h"

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <string>
#include <vector>

#include "lockstep/error.h"

namespace lockstep {
namespace {

bool always() { return true; }

#ifdef __x86_64__
[[maybe_unused]] bool has_avx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
[[maybe_unused]] bool has_avx512() {
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#endif

// Automatic takes the first one that runs here. baseline runs everywhere.
std::vector<TargetKernels>& all_kernels() {
  static std::vector<TargetKernels> all = {
#ifdef LOCKSTEP_HAS_AVX512
      {Target::avx512, "avx512", has_avx512, avx512_f32, avx512_f64},
#endif
#ifdef LOCKSTEP_HAS_AVX2
      {Target::avx2, "avx2", has_avx2, avx2_f32, avx2_f64},
#endif
#ifdef LOCKSTEP_HAS_NEON
      {Target::neon, "neon", always, neon_f32, neon_f64},
#endif
      {Target::baseline, "baseline", always, baseline_f32, baseline_f64},
  };
  return all;
}

const TargetKernels* choice(Target target) {
  for (const TargetKernels& c : all_kernels())
    if ((c.target == target || target == Target::automatic) && c.runs_here()) return &c;
  return nullptr;
}

// The target that LOCKSTEP_TARGET names, automatic if it is not set.
Target environment_target() {
  const char* variable = std::getenv("LOCKSTEP_TARGET");
  if (!variable || !*variable) return Target::automatic;
  std::string names;
  for (Target t : all_targets) {
    if (std::string(variable) == to_string(t)) return t;
    names += (names.empty() ? "" : ", ") + std::string(to_string(t));
  }
  throw SettingsError("LOCKSTEP_TARGET", std::string("is '") + variable + "', which is no target",
                      "use one of " + names);
}

}  // namespace

void add_target(const TargetKernels& kernels) { all_kernels().push_back(kernels); }

const char* to_string(Target target) noexcept {
  switch (target) {
    case Target::baseline: return "baseline";
    case Target::avx2: return "avx2";
    case Target::avx512: return "avx512";
    case Target::neon: return "neon";
    case Target::automatic: return "automatic";
  }
  for (const TargetKernels& c : all_kernels())
    if (c.target == target) return c.name;
  return "unknown";
}

bool supported(Target target) noexcept { return choice(target) != nullptr; }

Target resolve(Target wanted) {
  if (wanted == Target::automatic) wanted = environment_target();
  if (const TargetKernels* found = choice(wanted)) return found->target;
  if (std::find(std::begin(all_targets), std::end(all_targets), wanted) == std::end(all_targets))
    throw SettingsError("target " + std::to_string(static_cast<int>(wanted)), "is none of the enumerators",
                        "give one of Target");
  throw SettingsError(std::string("target ") + to_string(wanted), "this machine lacks its instructions",
                      "use automatic");
}

template <>
const KernelSet<float>& kernels_for<float>(Target target) {
  return choice(target)->f32;
}

template <>
const KernelSet<double>& kernels_for<double>(Target target) {
  return choice(target)->f64;
}

}  // namespace lockstep
