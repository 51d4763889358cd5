// Flops and memory of a step. SPDX-License-Identifier: Apache-2.0
#include "count.h"

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
  std::vector<std::vector<float>> blocks;
  const auto block = [&](int rows) {
    result.rows += rows;
    return blocks.emplace_back(static_cast<std::size_t>(rows) + 1, 0.5f).data();
  };
  batch.position = block(t.joints);
  batch.velocity = block(t.joints);
  if (t.turning.count > 0) batch.angle = block(t.joints);
  batch.position_target = block(t.joints * t.input_times);
  batch.velocity_target = block(t.joints * t.input_times);
  batch.effort = block(t.joints * t.input_times);
  if (t.roots.count > 0) batch.root_pose = block(7 * t.roots.count), batch.root_velocity = block(6 * t.roots.count);
  if (t.record_impulses) batch.impulse = block(t.couplings);
  if (t.record_diagnostics)
    batch.residual = block(t.reported.count), batch.row_state = block(t.reported.count), batch.energy = block(4);
  for (int f = 0; f < parameter_count; ++f)
    if ((t.per_environment >> f) & 1u) batch.fields[f] = block(rows_of(t, static_cast<Parameter>(f)));
  if (t.audited) batch.audit = block(2);
  t.audited = false;  // count a step that is neither fast nor coarse
  t.coarse_above = 1e30f;
  std::vector<Fault> fault(1, Fault::none);
  batch.fault = fault.data();

  kernels::Tile<Counted> x;
  std::vector<std::max_align_t> scratch(kernels::lay_out(t, nullptr, x) / sizeof(std::max_align_t) + 1);
  operation_count = {};
  kernels::advance<Counted>(t, batch, 0, 0, 1, scratch.data());
  const long once = operation_count.flops;  // per call, for any number of environments
  operation_count = {};
  kernels::advance<Counted>(t, batch, 0, 1, 1, scratch.data());
  result.flops = operation_count.flops - once;
  result.numbers = static_cast<long>(operation_count.loaded.size() + operation_count.stored.size());
  return result;
}

}  // namespace lockstep::counting
