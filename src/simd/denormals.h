// Numbers too small to be normal are taken for zero while kernels run. SPDX-License-Identifier: Apache-2.0
//
// A mechanism that comes to rest would otherwise spend most of its time in the processor's slow path for them.
// Part of the promise of same bits: every target steps in this mode.
#pragma once

#include "wide.h"

namespace lockstep::simd {

/// Flush-to-zero and denormals-are-zero for the calling thread, until the end of the scope.
class FlushDenormals {
 public:
  LOCKSTEP_INLINE FlushDenormals() : before_(__builtin_ia32_stmxcsr()) { __builtin_ia32_ldmxcsr(before_ | 0x8040u); }
  LOCKSTEP_INLINE ~FlushDenormals() { __builtin_ia32_ldmxcsr(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};
}  // namespace lockstep::simd
