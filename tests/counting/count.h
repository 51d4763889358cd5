// Flops and memory of a step, from one run of the kernels on counting numbers. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/plan.h"

namespace lockstep::counting {

struct Count {
  long flops = 0;    ///< of one step of one environment
  long numbers = 0;  ///< of the batch that the step reads and writes; repeated accesses count once
  long rows = 0;     ///< of the batch's arrays
};

Count count(const Plan& plan);

}  // namespace lockstep::counting
