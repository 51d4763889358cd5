// AVX-512: multiply-adds round once. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> avx512_f32 = kernel_set<registers::avx512::f32>();
const KernelSet<double> avx512_f64 = kernel_set<registers::avx512::f64>();

LOCKSTEP_CALLED_STAGES(, registers::avx512::f32);
LOCKSTEP_CALLED_STAGES(, registers::avx512::f64);

}  // namespace lockstep
