// Plan's costs: operations and bytes. SPDX-License-Identifier: Apache-2.0
#include "cost.h"

#include "kernels/tile/state_pointers.h"
#include "lockstep/plan.h"

namespace lockstep {

long Plan::flops_per_step() const { return trace::cost_of(*program_).flops; }

namespace {

// The sum of count(block) numbers of all rows of a batch, in bytes.
template <class S, class Count>
long bytes_of(const Tables<S>& t, const Count& count) {
  long bytes = 0;
  StatePointers<S> rows;
  each_block(
      t, [&](const BatchBlock& block, const auto* own) { bytes += count(block) * static_cast<long>(sizeof(*own)); },
      rows);
  return bytes;
}

template <class Count>
long bytes_of(const Program& program, int scalar_bytes, const Count& count) {
  return scalar_bytes == 4 ? bytes_of(program.f32, count) : bytes_of(program.f64, count);
}

}  // namespace

long Plan::bytes_per_step(int scalar_bytes) const {
  const long loaded = static_cast<long>(trace::cost_of(*program_).loaded.size());
  return loaded * scalar_bytes +
         bytes_of(*program_, scalar_bytes, [](const BatchBlock& block) { return block.traffic; });
}

long Plan::bytes_per_environment(int scalar_bytes) const {
  return bytes_of(*program_, scalar_bytes, [](const BatchBlock& block) { return block.rows; });
}

}  // namespace lockstep
