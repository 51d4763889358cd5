// What every processor has, and its scalar twin: multiply-adds round twice. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

using simd::Unfused;
using simd::Wide;

const KernelSet<float> baseline_f32 = kernel_set<registers::baseline::f32>();
const KernelSet<double> baseline_f64 = kernel_set<registers::baseline::f64>();
const KernelSet<float> baseline_scalar_f32 = kernel_set<Wide<float, 1, Unfused>>();
const KernelSet<double> baseline_scalar_f64 = kernel_set<Wide<double, 1, Unfused>>();

LOCKSTEP_CALLED_STAGES(, registers::baseline::f32);
LOCKSTEP_CALLED_STAGES(, registers::baseline::f64);

}  // namespace lockstep
