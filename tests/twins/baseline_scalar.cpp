// The scalar twin of baseline. SPDX-License-Identifier: Apache-2.0
#include "targets/instantiate.h"

namespace lockstep {

extern const KernelSet<float> baseline_scalar_f32;
extern const KernelSet<double> baseline_scalar_f64;
const KernelSet<float> baseline_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Unfused>>();
const KernelSet<double> baseline_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Unfused>>();

}  // namespace lockstep
