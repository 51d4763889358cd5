// AArch64, and its scalar twin: multiply-adds round once. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

using simd::Fused;
using simd::Wide;

const KernelSet<float> neon_f32 = kernel_set<registers::neon::f32>();
const KernelSet<double> neon_f64 = kernel_set<registers::neon::f64>();
const KernelSet<float> neon_scalar_f32 = kernel_set<Wide<float, 1, Fused>>();
const KernelSet<double> neon_scalar_f64 = kernel_set<Wide<double, 1, Fused>>();

LOCKSTEP_CALLED_STAGES(, registers::neon::f32);
LOCKSTEP_CALLED_STAGES(, registers::neon::f64);

}  // namespace lockstep
