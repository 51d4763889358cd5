// The kernels of one wide type, as a KernelSet. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "jit/run.h"
#include "kernel_set.h"
#include "kernels/step.h"
#include "registers.h"

namespace lockstep {

template <class T>
std::size_t scratch_bytes(const Tables<typename T::Scalar>& t) {
  kernels::Tile<T> x;
  kernels::Motion<T> m;
  kernels::InverseDynamics<T> found;
  kernels::Carver behind(nullptr);
  found.arrays(t, behind);
  return kernels::lay_out(t, nullptr, x, m) + behind.used();
}

template <class T>
constexpr KernelSet<typename T::Scalar> kernel_set() {
  return {T::lanes,
          scratch_bytes<T>,
          kernels::advance_by_tables<T>,
          kernels::advance_by_code<T>,
          kernels::find_places<T>,
          kernels::read<T>,
          kernels::read_frames<T>,
          kernels::read_accelerations<T>,
          kernels::read_contacts<T>,
          kernels::scan_heights<T>};
}

}  // namespace lockstep
