// Generated files include this. They are compiled once for each instruction set. SPDX-License-Identifier: Apache-2.0
//
// LOCKSTEP_KERNEL_TARGET names the instruction set. The file is compiled with its flags.
#pragma once

#include "called_stages.h"
#include "generated_kernel.h"
#include "registers.h"

#ifndef LOCKSTEP_KERNEL_TARGET
#define LOCKSTEP_KERNEL_TARGET baseline
#endif
#define LOCKSTEP_JOINED_(a, b) a##_##b
#define LOCKSTEP_JOINED(a, b) LOCKSTEP_JOINED_(a, b)
#define LOCKSTEP_QUOTED_(a) #a
#define LOCKSTEP_QUOTED(a) LOCKSTEP_QUOTED_(a)
/// The kernel's name for the linker: one for each instruction set.
#define LOCKSTEP_KERNEL(id) LOCKSTEP_JOINED(id, LOCKSTEP_KERNEL_TARGET)

namespace lockstep {

LOCKSTEP_CALLED_STAGES(extern, registers::LOCKSTEP_KERNEL_TARGET::f32);
LOCKSTEP_CALLED_STAGES(extern, registers::LOCKSTEP_KERNEL_TARGET::f64);

/// A step by generated code, in place of ByTables.
template <class Step>
struct ByKernel : Step {
  LOCKSTEP_INLINE int tiles() const { return Step::tiles_per_call; }
  LOCKSTEP_INLINE int carried() const { return Step::carried_values; }
  template <class T>
  LOCKSTEP_INLINE void begin(const Tables<typename T::Scalar>&, const StatePointers<typename T::Scalar>&,
                             kernels::Tile<T>&, T*, int) {}
};

template <class T, class Step>
void advance_by_kernel(const Tables<typename T::Scalar>& t, const StatePointers<typename T::Scalar>& batch,
                       std::ptrdiff_t first, std::ptrdiff_t last, int substeps, void* scratch) {
  kernels::advance<T>(t, batch, first, last, substeps, scratch, ByKernel<Step>{});
}

template <class Step, bool f32, bool f64>
constexpr GeneratedKernel generated_kernel(const char* name, const char* version, std::uint64_t hash) {
  using Registers = registers::LOCKSTEP_KERNEL_TARGET;
  GeneratedKernel kernel{name,
                         version,
                         LOCKSTEP_QUOTED(LOCKSTEP_KERNEL_TARGET),
                         hash,
                         nullptr,
                         nullptr,
                         Step::tiles_per_call,
                         Step::carried_values};
  if constexpr (f32) kernel.f32 = advance_by_kernel<typename Registers::f32, Step>;
  if constexpr (f64) kernel.f64 = advance_by_kernel<typename Registers::f64, Step>;
  return kernel;
}

}  // namespace lockstep
