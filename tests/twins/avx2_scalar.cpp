// The scalar twin of avx2. SPDX-License-Identifier: Apache-2.0
#include "targets/instantiate.h"

namespace lockstep {

extern const KernelSet<float> avx2_scalar_f32;
extern const KernelSet<double> avx2_scalar_f64;
const KernelSet<float> avx2_scalar_f32 = kernel_set<simd::Wide<float, 1, simd::Fused>>();
const KernelSet<double> avx2_scalar_f64 = kernel_set<simd::Wide<double, 1, simd::Fused>>();

}  // namespace lockstep
