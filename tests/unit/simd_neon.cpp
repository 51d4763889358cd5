// Wide numbers on AArch64. SPDX-License-Identifier: Apache-2.0
#include "simd_operations.h"

namespace lockstep::simd_test {

constinit const Operations<float> neon_f32 = operations<float, 4, simd::Fused>("neon");
constinit const Operations<double> neon_f64 = operations<double, 2, simd::Fused>("neon");
constinit const Operations<float> neon_scalar_f32 = operations<float, 1, simd::Fused>("neon_scalar");
constinit const Operations<double> neon_scalar_f64 = operations<double, 1, simd::Fused>("neon_scalar");

}  // namespace lockstep::simd_test
