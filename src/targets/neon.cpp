// AArch64: multiply-adds round once. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> neon_f32 = kernel_set<registers::neon::f32>();
const KernelSet<double> neon_f64 = kernel_set<registers::neon::f64>();

LOCKSTEP_CALLED_STAGES(, registers::neon::f32);
LOCKSTEP_CALLED_STAGES(, registers::neon::f64);

}  // namespace lockstep
