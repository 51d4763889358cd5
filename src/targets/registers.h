// The wide types of each instruction set: one register of numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "simd/wide.h"

namespace lockstep::registers {

struct baseline {  // what every processor has
  using f32 = simd::Wide<float, 4, simd::Unfused>;
  using f64 = simd::Wide<double, 2, simd::Unfused>;
};
struct avx2 {
  using f32 = simd::Wide<float, 8, simd::Fused>;
  using f64 = simd::Wide<double, 4, simd::Fused>;
};
struct avx512 {
  using f32 = simd::Wide<float, 16, simd::Fused>;
  using f64 = simd::Wide<double, 8, simd::Fused>;
};
struct neon {
  using f32 = simd::Wide<float, 4, simd::Fused>;
  using f64 = simd::Wide<double, 2, simd::Fused>;
};

}  // namespace lockstep::registers
