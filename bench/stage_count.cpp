// The stages and their flops. SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "counting/counted.h"
#include "stage_kernels.h"
#include "stages.h"

namespace lockstep::bench {

using CountedStages = Stages<Counted>;

int stage_count() { return CountedStages::count; }
const char* stage_name(int stage) { return CountedStages::all[stage].name; }
bool stage_present(const Tables<float>& t, int stage) { return CountedStages::all[stage].present(t); }

long stage_flops(const Tables<float>& t, const StatePointers<float>& batch, int stages) {
  kernels::Tile<Counted> x;
  std::vector<std::max_align_t> scratch(kernels::lay_out(t, nullptr, x) / sizeof(std::max_align_t) + 1);
  kernels::lay_out(t, scratch.data(), x);
  kernels::uniform_masses(t, x);
  kernels::uniform_ratios(t, x);
  operation_count = {};
  CountedStages::run(t, batch, x, stages);
  return operation_count.flops;
}

}  // namespace lockstep::bench
