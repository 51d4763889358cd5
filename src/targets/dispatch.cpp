#include "dispatch.h"

#include <cstdlib>
#include <string>

#include "lockstep/error.h"

namespace lockstep {

const char* name(Target target) noexcept {
  switch (target) {
    case Target::baseline: return "baseline";
    case Target::baseline_scalar: return "baseline_scalar";
    case Target::avx2: return "avx2";
    case Target::avx2_scalar: return "avx2_scalar";
    case Target::automatic: break;
  }
  return "automatic";
}

bool supported(Target target) noexcept {
  if (target == Target::avx2 || target == Target::avx2_scalar)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  return true;
}

Target resolve(Target wanted) {
  if (const char* variable = std::getenv("LOCKSTEP_TARGET"); wanted == Target::automatic && variable && *variable) {
    for (Target t : {Target::baseline, Target::baseline_scalar, Target::avx2, Target::avx2_scalar})
      if (std::string(variable) == name(t)) wanted = t;
    if (wanted == Target::automatic)
      throw SettingsError("LOCKSTEP_TARGET", std::string("is '") + variable + "', which is no target",
                          "use baseline, baseline_scalar, avx2 or avx2_scalar");
  }
  if (wanted == Target::automatic) return supported(Target::avx2) ? Target::avx2 : Target::baseline;
  if (!supported(wanted))
    throw SettingsError(std::string("target ") + name(wanted), "this machine lacks its instructions", "use automatic");
  return wanted;
}

template <>
const KernelSet<float>& kernels_for<float>(Target target) {
  switch (target) {
    case Target::avx2: return avx2_f32;
    case Target::avx2_scalar: return avx2_scalar_f32;
    case Target::baseline_scalar: return baseline_scalar_f32;
    default: return baseline_f32;
  }
}

template <>
const KernelSet<double>& kernels_for<double>(Target target) {
  switch (target) {
    case Target::avx2: return avx2_f64;
    case Target::avx2_scalar: return avx2_scalar_f64;
    case Target::baseline_scalar: return baseline_scalar_f64;
    default: return baseline_f64;
  }
}

}  // namespace lockstep
