// What Batch::rollout() takes: sequences of controls, and numbers of each step. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "lockstep/actions.h"

namespace lockstep {

/// Numbers of rollouts in memory of the caller: number k of control step t of rollout i stands at
/// data[i * rollout_stride + t * step_stride + k * row_stride]. Strides count numbers.
template <class S>
struct StridedSteps {
  S* data = nullptr;
  std::ptrdiff_t rollout_stride = 0, step_stride = 0, row_stride = 1;
};

struct RolloutOptions {
  int rollouts = 1;    ///< >= 1, more or fewer than the batch has environments
  int steps = 1;       ///< control steps of each, >= 1
  int substeps = 1;    ///< steps of dt in a control step, >= 1
  ActionMap map = {};  ///< what controls mean
};

}  // namespace lockstep
