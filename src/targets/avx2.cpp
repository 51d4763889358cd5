// AVX2 and FMA: multiply-adds round once. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> avx2_f32 = kernel_set<registers::avx2::f32>();
const KernelSet<double> avx2_f64 = kernel_set<registers::avx2::f64>();

LOCKSTEP_CALLED_STAGES(, registers::avx2::f32);
LOCKSTEP_CALLED_STAGES(, registers::avx2::f64);

}  // namespace lockstep
