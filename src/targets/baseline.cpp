// The instructions that every processor has: multiply-adds round twice. SPDX-License-Identifier: Apache-2.0
#include "called_stages.h"
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> baseline_f32 = kernel_set<registers::baseline::f32>();
const KernelSet<double> baseline_f64 = kernel_set<registers::baseline::f64>();

LOCKSTEP_CALLED_STAGES(, registers::baseline::f32);
LOCKSTEP_CALLED_STAGES(, registers::baseline::f64);

}  // namespace lockstep
