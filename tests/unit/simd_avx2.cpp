// Wide numbers with AVX2 and FMA, for machines that have them. SPDX-License-Identifier: Apache-2.0
#include "simd_operations.h"

namespace lockstep::simd_test {

constinit const Operations<float> avx2_f32 = operations<float, 8, simd::Fused>("avx2");
constinit const Operations<double> avx2_f64 = operations<double, 4, simd::Fused>("avx2");
constinit const Operations<float> avx2_scalar_f32 = operations<float, 1, simd::Fused>("avx2_scalar");
constinit const Operations<double> avx2_scalar_f64 = operations<double, 1, simd::Fused>("avx2_scalar");

}  // namespace lockstep::simd_test
