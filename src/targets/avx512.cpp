// AVX-512: multiply-adds round once, so avx2_scalar is its scalar twin. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

using simd::Fused;
using simd::Wide;

const KernelSet<float> avx512_f32 = kernel_set<Wide<float, 16, Fused>>();
const KernelSet<double> avx512_f64 = kernel_set<Wide<double, 8, Fused>>();

}  // namespace lockstep
