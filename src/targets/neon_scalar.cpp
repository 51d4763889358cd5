// The scalar twin of AArch64: the same bits, one environment at a time. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> neon_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Fused>>();
const KernelSet<double> neon_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Fused>>();

}  // namespace lockstep
