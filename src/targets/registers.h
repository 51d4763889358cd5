// The numbers that each instruction set computes with: one register of them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../simd/wide.h"

namespace lockstep::registers {

struct baseline {  // SSE2, every x86-64
  using f32 = simd::Wide<float, 4, simd::Unfused>;
  using f64 = simd::Wide<double, 2, simd::Unfused>;
};
struct avx2 {
  using f32 = simd::Wide<float, 8, simd::Fused>;
  using f64 = simd::Wide<double, 4, simd::Fused>;
};

}  // namespace lockstep::registers
