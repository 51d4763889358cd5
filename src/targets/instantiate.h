// The kernels for one wide type. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "interpret/run.h"
#include "kernel_set.h"
#include "kernels/step.h"
#include "lockstep/export.h"
#include "registers.h"

namespace lockstep {

template <class T>
std::size_t scratch_bytes(const Tables<typename T::Scalar>& t) {
  kernels::Tile<T> x;
  kernels::Motion<T> m;
  return kernels::lay_out(t, nullptr, x, m);
}

template <class T>
constexpr KernelSet<typename T::Scalar> kernel_set() {
  return {T::lanes,        scratch_bytes<T>, kernels::advance<T>, kernels::interpreter_bytes<T>, kernels::interpret<T>,
          kernels::read<T>};
}

/// The stages that generated code calls, long and full of branches: compiled once, with the library, for each
/// instruction set's T, and not again with every kernel.
#define LOCKSTEP_CALLED_STAGES(linkage, T)                                                                            \
  linkage template LOCKSTEP_API bool kernels::bounds_active(const Tables<T::Scalar>&, kernels::Tile<T>&);             \
  linkage template LOCKSTEP_API void kernels::solve_bounds(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&, \
                                                           kernels::Tile<T>&);                                        \
  linkage template LOCKSTEP_API void kernels::coupling_impulses(const Tables<T::Scalar>&, kernels::Tile<T>&);         \
  linkage template LOCKSTEP_API void kernels::diagnose(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,     \
                                                       kernels::Tile<T>&);                                            \
  linkage template LOCKSTEP_API void kernels::hold(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,         \
                                                   kernels::Tile<T>&, T::Mask);                                       \
  linkage template LOCKSTEP_API void kernels::limited_drives(const Tables<T::Scalar>&,                                \
                                                             const StatePointers<T::Scalar>&, kernels::Tile<T>&);     \
  linkage template LOCKSTEP_API bool kernels::saturation_differs(const Tables<T::Scalar>&,                            \
                                                                 const StatePointers<T::Scalar>&, kernels::Tile<T>&)

}  // namespace lockstep
