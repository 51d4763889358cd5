// What goes between a batch and a tile. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Read from the tables, or known when generated code is compiled: its loops over these are unrolled then.
struct Outline {
  int joints;
  const int* joint_row;  ///< [joints] in the batch
  bool floating;
  std::uint32_t per_environment;
  bool record_impulses, record_diagnostics;
  bool shortens;         ///< it is asked whether all followers are in place
  int pair_count;        ///< what to ask, if all followers are of one joint
  const Pair* pairs;
};

template <class S>
LOCKSTEP_INLINE Outline outline(const Tables<S>& t) {
  const Reduction<S>& r = t.reduction;
  return {t.joints, t.joint_row.data, t.floating, t.per_environment, t.record_impulses, t.record_diagnostics,
          r.shortens, r.shortens ? r.pairs.count : 0, r.pairs.data};
}

/// The same lanes, moved to begin at environment `first`.
template <class S>
LOCKSTEP_INLINE Lanes<S> at(Lanes<S> lanes, std::ptrdiff_t first, const Outline& o) {
  lanes.position += first;
  lanes.velocity += first;
  if (o.floating) lanes.root_pose += first, lanes.root_velocity += first;
  lanes.position_target += first;
  lanes.velocity_target += first;
  lanes.effort += first;
  for (int f = 0; o.per_environment != 0 && f < parameter_fields; ++f)
    if (lanes.field[f]) lanes.field[f] += first;
  if (o.record_impulses && lanes.impulse) lanes.impulse += first;
  if (o.record_diagnostics && lanes.residual) lanes.residual += first, lanes.row_state += first;
  if (o.record_diagnostics) lanes.energy += first;
  lanes.fault += first;
  return lanes;
}

}  // namespace lockstep::kernels
