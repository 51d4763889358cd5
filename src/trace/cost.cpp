// Plan's costs: operations and bytes. SPDX-License-Identifier: Apache-2.0
#include "cost.h"

#include "kernels/tile/state_pointers.h"
#include "lockstep/plan.h"

namespace lockstep {

long Plan::flops_per_step() const { return trace::cost_of(*program_).flops; }

long Plan::bytes_per_step(int scalar_bytes) const {
  const Tables<double>& t = program_->f64;
  const long state = 2 * t.joints + (7 + 6) * t.roots.count;
  const long recorded = (t.record_impulses ? t.couplings : 0) + (t.record_diagnostics ? 2 * t.reported.count + 4 : 0);
  const long loaded = static_cast<long>(trace::cost_of(*program_).loaded.size());
  const long angles = t.turning.count;  // stored
  return (2 * state + angles + loaded + recorded) * scalar_bytes +
         static_cast<long>(sizeof(Fault) + 2 * sizeof(std::uint32_t));
}

long Plan::bytes_per_environment(int scalar_bytes) const {
  const Tables<double>& t = program_->f64;
  long rows = 2 * t.joints + 3 * t.joints * t.input_times + (7 + 6) * t.roots.count;
  if (t.turning.count > 0) rows += t.joints;
  if (t.record_impulses) rows += t.couplings;
  if (t.audited) rows += 2;
  rows += t.contacts.remembered(t);
  if (t.record_diagnostics) rows += 2 * t.reported.count + 4;
  for (unsigned p = 0; p < parameter_count; ++p)
    if (t.declares(static_cast<Parameter>(p))) rows += parameter_rows(static_cast<Parameter>(p));
  constexpr long counts = 3 * sizeof(std::uint32_t) + sizeof(std::uint64_t);  // steps, resets, id, seed
  return rows * scalar_bytes + static_cast<long>(sizeof(Fault) + sizeof(FaultPlace)) + counts;
}

}  // namespace lockstep
