// Treats denormal numbers as zero while kernels run. SPDX-License-Identifier: Apache-2.0
//
// Otherwise a mechanism that comes to rest would spend most of its time in the slow path of the processor for them.
// Every target steps in this mode, so that all have the same bits.
#pragma once

#include "wide.h"

namespace lockstep::simd {

#ifdef __aarch64__
LOCKSTEP_INLINE unsigned floating_point_mode() { return __builtin_aarch64_get_fpcr(); }
LOCKSTEP_INLINE void set_floating_point_mode(unsigned mode) { __builtin_aarch64_set_fpcr(mode); }
constexpr unsigned flushing = 1u << 24;  // FZ: operands and results
#else
LOCKSTEP_INLINE unsigned floating_point_mode() { return __builtin_ia32_stmxcsr(); }
LOCKSTEP_INLINE void set_floating_point_mode(unsigned mode) { __builtin_ia32_ldmxcsr(mode); }
constexpr unsigned flushing = 0x8040u;  // FTZ and DAZ
#endif

/// Flush-to-zero and denormals-are-zero for the calling thread, until the end of the scope.
class FlushDenormals {
 public:
  LOCKSTEP_INLINE FlushDenormals() : before_(floating_point_mode()) { set_floating_point_mode(before_ | flushing); }
  LOCKSTEP_INLINE ~FlushDenormals() { set_floating_point_mode(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned before_;
};
}  // namespace lockstep::simd
