// What a step costs: the kernels run once on numbers that count operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>

#include "plan/program.h"

namespace lockstep::trace {

struct Cost {
  long flops = 0;
  std::set<const double*> loaded;  ///< numbers of inputs and fields that the step reads
};

Cost cost_of(const Program& program);

/// Steps of more flops have no straight-line code: to trace them takes minutes.
constexpr long most_traced_flops = 400000;

}  // namespace lockstep::trace
