// Flops and memory of a step. SPDX-License-Identifier: Apache-2.0
#include "count.h"

#include <algorithm>
#include <vector>

#include "counted.h"
#include "kernels/step.h"
#include "plan/program.h"

namespace lockstep::counting {

Count count(const Plan& plan) {
  const Program& program = program_of(plan);
  Count result;
  Tables<float> t = program.f32;
  t.reduction.consistent_is_shorter = false;  // count the step for inconsistent followers
  StatePointers<float> batch;
  batch.stride = 1;
  std::vector<std::vector<std::uint64_t>> blocks;
  each_block(
      t,
      [&]<class E>(const BatchBlock& block, E*& rows) {
        using Number = std::remove_const_t<E>;
        if (block.rows == 0) return;
        auto* const own = reinterpret_cast<Number*>(blocks.emplace_back(static_cast<std::size_t>(block.rows)).data());
        rows = own;
        if constexpr (std::is_same_v<Number, float>) result.rows += block.rows, std::fill_n(own, block.rows, 0.5f);
      },
      batch);
  t.audited = false;  // count a step that is neither fast nor coarse
  t.coarse_above = 1e30f;

  kernels::Tile<Counted> x;
  std::vector<std::max_align_t> scratch(kernels::lay_out(t, nullptr, x) / sizeof(std::max_align_t) + 1);
  operation_count = {};
  kernels::advance_by_tables<Counted>(t, batch, 0, 0, 1, scratch.data());
  const long once = operation_count.flops;  // per call, for any number of environments
  operation_count = {};
  kernels::advance_by_tables<Counted>(t, batch, 0, 1, 1, scratch.data());
  result.flops = operation_count.flops - once;
  result.numbers = static_cast<long>(operation_count.loaded.size() + operation_count.stored.size());
  return result;
}

}  // namespace lockstep::counting
