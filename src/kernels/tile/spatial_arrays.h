// Arrays of the spatial tendons. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "diagnostic_arrays.h"

namespace lockstep::kernels {

template <class T>
struct SpatialArrays {
  Motion<T> motion;  // where S is
  T* reach;          // [tendons] (M180): what a correction in one step may move a length by

  template <class Take>
  void arrays(const Tables<ScalarOf<T>>& t, Take& take) {
    motion.arrays(t, take);
    take("spatial.reach", reach, t.spatial.tendons.count);
  }
};

}  // namespace lockstep::kernels
