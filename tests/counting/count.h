// Flops and memory of a step: the kernels themselves, run once on a number that counts. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "lockstep/plan.h"

namespace lockstep::counting {

struct Count {
  long flops = 0;    ///< of one step of one environment
  long numbers = 0;  ///< of a batch that it reads and writes, each once however often
  long rows = 0;     ///< of a batch
};

Count count(const Plan& plan);

}  // namespace lockstep::counting
