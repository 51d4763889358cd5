// How long what stands in an array of a tile is of use. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::kernels {

enum class Lifetime {
  stage,  ///< only within a stage, or until the next one has read it
  step,   ///< other stages of the step may read it
  call,   ///< made before the first step of a call, and the same in all of them
  state,  ///< the next step starts from it
};

}  // namespace lockstep::kernels
