// Wide numbers with AVX-512, for machines that have it. SPDX-License-Identifier: Apache-2.0
#include "simd_operations.h"

namespace lockstep::simd_test {

constinit const Operations<float> avx512_f32 = operations<float, 16, simd::Fused>("avx512");
constinit const Operations<double> avx512_f64 = operations<double, 8, simd::Fused>("avx512");

}  // namespace lockstep::simd_test
