// SPDX-License-Identifier: Apache-2.0
#include "twins.h"

#include "targets/dispatch.h"

namespace lockstep {

// Compiled each by itself, as the kernels are.
extern const KernelSet<float> baseline_scalar_f32, avx2_scalar_f32, neon_scalar_f32;
extern const KernelSet<double> baseline_scalar_f64, avx2_scalar_f64, neon_scalar_f64;

namespace twins {

bool add() {
  static const bool once = [] {
    add_target({baseline_scalar, "baseline_scalar", [] { return true; }, baseline_scalar_f32, baseline_scalar_f64});
#ifdef __x86_64__
    add_target({avx2_scalar, "avx2_scalar", [] { return supported(Target::avx2); }, avx2_scalar_f32, avx2_scalar_f64});
#endif
#ifdef __aarch64__
    add_target({neon_scalar, "neon_scalar", [] { return true; }, neon_scalar_f32, neon_scalar_f64});
#endif
    return true;
  }();
  return once;
}

}  // namespace twins
}  // namespace lockstep
