// How long the contents of an array of a tile are needed. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep::kernels {

enum class Lifetime {
  stage,  ///< within a stage, or until the next stage has read it
  step,   ///< other stages of the step may read it
  call,   ///< set before the first step of a call, constant in all its steps
  turn,   ///< the same, but a step that ends with a joint's turn changes it
  state,  ///< the next step starts from it
};

}  // namespace lockstep::kernels
