// AVX-512: multiply-adds round once, so avx2_scalar is its scalar twin. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> avx512_f32 = kernel_set<registers::avx512::f32>();
const KernelSet<double> avx512_f64 = kernel_set<registers::avx512::f64>();

LOCKSTEP_CALLED_STAGES(, registers::avx512::f32);
LOCKSTEP_CALLED_STAGES(, registers::avx512::f64);

}  // namespace lockstep
