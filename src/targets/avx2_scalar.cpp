// The scalar twin of AVX2 and FMA: the same bits, one environment at a time. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> avx2_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Fused>>();
const KernelSet<double> avx2_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Fused>>();

}  // namespace lockstep
