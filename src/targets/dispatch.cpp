#include "dispatch.h"

#include <cstdlib>
#include <string>

#include "lockstep/error.h"

namespace lockstep {
namespace {

struct Choice {
  Target target;
  bool (*runs_here)();
  const KernelSet<float>& f32;
  const KernelSet<double>& f64;
};

bool always() { return true; }

#ifdef __x86_64__
bool has_avx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
bool has_avx512() {
  return has_avx2() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#endif

// What automatic takes first stands first.
const Choice choices[] = {
#ifdef __x86_64__
    {Target::avx512, has_avx512, avx512_f32, avx512_f64},
    {Target::avx2, has_avx2, avx2_f32, avx2_f64},
    {Target::avx2_scalar, has_avx2, avx2_scalar_f32, avx2_scalar_f64},
#endif
#ifdef __aarch64__
    {Target::neon, always, neon_f32, neon_f64},
    {Target::neon_scalar, always, neon_scalar_f32, neon_scalar_f64},
#endif
    {Target::baseline, always, baseline_f32, baseline_f64},
    {Target::baseline_scalar, always, baseline_scalar_f32, baseline_scalar_f64},
};

const Choice* choice(Target target) {
  for (const Choice& c : choices)
    if (c.runs_here() && (c.target == target || target == Target::automatic)) return &c;
  return nullptr;
}

// The one that LOCKSTEP_TARGET names, automatic if it is not set.
Target environment_target() {
  const char* variable = std::getenv("LOCKSTEP_TARGET");
  if (!variable || !*variable) return Target::automatic;
  std::string names;
  for (Target t : all_targets) {
    if (std::string(variable) == name(t)) return t;
    names += (names.empty() ? "" : ", ") + std::string(name(t));
  }
  throw SettingsError("LOCKSTEP_TARGET", std::string("is '") + variable + "', which is no target",
                      "use one of " + names);
}

}  // namespace

const char* name(Target target) noexcept {
  switch (target) {
    case Target::baseline: return "baseline";
    case Target::baseline_scalar: return "baseline_scalar";
    case Target::avx2: return "avx2";
    case Target::avx2_scalar: return "avx2_scalar";
    case Target::avx512: return "avx512";
    case Target::neon: return "neon";
    case Target::neon_scalar: return "neon_scalar";
    case Target::automatic: break;
  }
  return "automatic";
}

bool supported(Target target) noexcept { return choice(target) != nullptr; }

Target resolve(Target wanted) {
  if (wanted == Target::automatic) wanted = environment_target();
  if (const Choice* found = choice(wanted)) return found->target;
  throw SettingsError(std::string("target ") + name(wanted), "this machine lacks its instructions", "use automatic");
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
