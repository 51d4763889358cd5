// The kernels for one wide type. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "../kernels/listed.h"
#include "../kernels/step.h"
#include "kernel_set.h"
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
  return {T::lanes, scratch_bytes<T>, kernels::advance<T>, kernels::listed_bytes<T>, kernels::advance_listed<T>,
          kernels::read<T>};
}

}  // namespace lockstep
