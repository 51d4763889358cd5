// The floating-point mode of a step, whatever the host's is. SPDX-License-Identifier: Apache-2.0
//
// Rounding to nearest, no traps, and denormal numbers count as zero. Otherwise a mechanism that comes to rest would
// spend most of its time in the slow path of the processor for them. Every target steps in this mode, so that all have
// the same bits.
#pragma once

#include "wide.h"

namespace lockstep::simd {

#ifdef __aarch64__
LOCKSTEP_INLINE unsigned floating_point_mode() { return __builtin_aarch64_get_fpcr(); }
LOCKSTEP_INLINE void set_floating_point_mode(unsigned mode) { __builtin_aarch64_set_fpcr(mode); }
constexpr unsigned step_mode = 1u << 24;  // FZ for operands and results; zeros: nearest, no traps
#else
LOCKSTEP_INLINE unsigned floating_point_mode() { return __builtin_ia32_stmxcsr(); }
LOCKSTEP_INLINE void set_floating_point_mode(unsigned mode) { __builtin_ia32_ldmxcsr(mode); }
constexpr unsigned step_mode = 0x8040u | 0x1f80u;  // FTZ and DAZ; all exceptions masked; zeros: nearest
#endif

/// The mode of a step for the calling thread, until the end of the scope. Then mode and flags are those of before.
class StepMode {
 public:
  LOCKSTEP_INLINE StepMode() : before_(floating_point_mode()) { set_floating_point_mode(step_mode); }
  LOCKSTEP_INLINE ~StepMode() { set_floating_point_mode(before_); }
  StepMode(const StepMode&) = delete;
  StepMode& operator=(const StepMode&) = delete;

 private:
  unsigned before_;
};
}  // namespace lockstep::simd
