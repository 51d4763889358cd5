// The stages of the library that generated code calls. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/step.h"
#include "lockstep/export.h"

/// Stages that generated code calls, because they are long and full of branches. The library compiles them once for
/// each instruction set, so generated kernels need not.
#define LOCKSTEP_CALLED_STAGES(linkage, T)                                                                             \
  linkage template LOCKSTEP_API bool kernels::bounds_active(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&, \
                                                            kernels::Tile<T>&);                                        \
  linkage template LOCKSTEP_API void kernels::solve_bounds(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,  \
                                                           kernels::Tile<T>&);                                         \
  linkage template LOCKSTEP_API void kernels::step_again(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,    \
                                                         kernels::Tile<T>&);                                           \
  linkage template LOCKSTEP_API void kernels::audit(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,         \
                                                    kernels::Tile<T>&);                                                \
  linkage template LOCKSTEP_API void kernels::coupling_impulses(const Tables<T::Scalar>&,                              \
                                                                const StatePointers<T::Scalar>&, kernels::Tile<T>&);   \
  linkage template LOCKSTEP_API void kernels::diagnose(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,      \
                                                       kernels::Tile<T>&);                                             \
  linkage template LOCKSTEP_API void kernels::hold(const Tables<T::Scalar>&, const StatePointers<T::Scalar>&,          \
                                                   kernels::Tile<T>&, T::Mask);                                        \
  linkage template LOCKSTEP_API void kernels::limited_drives(const Tables<T::Scalar>&,                                 \
                                                             const StatePointers<T::Scalar>&, kernels::Tile<T>&);      \
  linkage template LOCKSTEP_API bool kernels::saturation_differs(const Tables<T::Scalar>&,                             \
                                                                 const StatePointers<T::Scalar>&, kernels::Tile<T>&)
