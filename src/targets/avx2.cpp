// AVX2 and FMA, and its scalar twin: multiply-adds round once. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

using simd::Fused;
using simd::Wide;

const KernelSet<float> avx2_f32 = kernel_set<registers::avx2::f32>();
const KernelSet<double> avx2_f64 = kernel_set<registers::avx2::f64>();
const KernelSet<float> avx2_scalar_f32 = kernel_set<Wide<float, 1, Fused>>();
const KernelSet<double> avx2_scalar_f64 = kernel_set<Wide<double, 1, Fused>>();

LOCKSTEP_CALLED_STAGES(, registers::avx2::f32);
LOCKSTEP_CALLED_STAGES(, registers::avx2::f64);

}  // namespace lockstep
