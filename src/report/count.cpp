// Flops and bytes of a step: the kernel itself, run once on a counting number. SPDX-License-Identifier: Apache-2.0
#include <vector>

#include "../kernels/step.h"
#include "../plan/program.h"
#include "counted.h"
#include "lockstep/batch.h"
#include "lockstep/plan.h"

namespace lockstep {
namespace {

struct Count {
  OperationCount done;
  long rows = 0;  // of a batch
};

Count count(const Program& program) {
  Count result;
  Tables<float> t = program.f32;
  t.reduction.shortens = false;  // wherever its followers are
  Lanes<float> lanes;
  lanes.stride = 1;
  std::vector<std::vector<float>> blocks;
  const auto block = [&](int rows) {
    result.rows += rows;
    return blocks.emplace_back(static_cast<std::size_t>(rows) + 1, 0.0f).data();
  };
  lanes.position = block(t.joints);
  lanes.velocity = block(t.joints);
  lanes.position_target = block(t.joints * t.input_times);
  lanes.velocity_target = block(t.joints * t.input_times);
  lanes.effort = block(t.joints * t.input_times);
  if (t.floating) lanes.root_pose = block(7), lanes.root_velocity = block(6);
  if (t.record_impulses) lanes.impulse = block(t.couplings);
  if (t.record_diagnostics)
    lanes.residual = block(t.reported.count), lanes.row_state = block(t.reported.count), lanes.energy = block(4);
  const int field_rows[parameter_count] = {t.term_gear.count, t.couplings, 2 * t.couplings, 2 * t.joints,
                                           t.joints, t.links, 3, 6 * t.links, t.couplings};
  for (int f = 0; f < parameter_count; ++f)
    if ((t.per_environment >> f) & 1u) lanes.field[f] = block(field_rows[f]);
  std::vector<Fault> fault(1, Fault::none);
  lanes.fault = fault.data();

  kernels::Tile<Counted> x;
  std::vector<std::max_align_t> scratch(kernels::lay_out(t, nullptr, x) / sizeof(std::max_align_t) + 1);
  operation_count = {};
  kernels::advance<Counted>(t, lanes, 0, 0, 1, scratch.data());
  const long once = operation_count.flops;  // for a call, however many environments it steps
  operation_count = {};
  kernels::advance<Counted>(t, lanes, 0, 1, 1, scratch.data());
  result.done = operation_count;
  result.done.flops -= once;
  return result;
}

}  // namespace

long Plan::flops_per_step() const { return count(*program_).done.flops; }

long Plan::bytes_per_step(int scalar_bytes) const {
  const OperationCount done = count(*program_).done;
  return static_cast<long>(done.loaded.size() + done.stored.size()) * scalar_bytes + static_cast<long>(sizeof(Fault));
}

long Plan::bytes_per_environment(int scalar_bytes) const {
  return count(*program_).rows * scalar_bytes + static_cast<long>(sizeof(Fault));
}

}  // namespace lockstep
