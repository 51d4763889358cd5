// The scalar twin of neon. SPDX-License-Identifier: Apache-2.0
#include "targets/instantiate.h"

namespace lockstep {

extern const KernelSet<float> neon_scalar_f32;
extern const KernelSet<double> neon_scalar_f64;
const KernelSet<float> neon_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Fused>>();
const KernelSet<double> neon_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Fused>>();

}  // namespace lockstep
