// The scalar twin of what every processor has: the same bits, one environment at a time. SPDX-License-Identifier: Apache-2.0
#include "instantiate.h"

namespace lockstep {

const KernelSet<float> baseline_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Unfused>>();
const KernelSet<double> baseline_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Unfused>>();

}  // namespace lockstep
