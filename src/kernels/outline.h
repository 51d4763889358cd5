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

/// Moves on by so many environments.
template <class S>
LOCKSTEP_INLINE void move(Lanes<S>& lanes, std::ptrdiff_t by, const Outline& o) {
  lanes.position += by;
  lanes.velocity += by;
  if (o.floating) lanes.root_pose += by, lanes.root_velocity += by;
  lanes.position_target += by;
  lanes.velocity_target += by;
  lanes.effort += by;
  for (int f = 0; o.per_environment != 0 && f < parameter_fields; ++f)
    if (lanes.field[f]) lanes.field[f] += by;
  if (o.record_impulses && lanes.impulse) lanes.impulse += by;
  if (o.record_diagnostics && lanes.residual) lanes.residual += by, lanes.row_state += by;
  if (o.record_diagnostics) lanes.energy += by;
  lanes.fault += by;
}

/// The same lanes, moved to begin at environment `first`.
template <class S>
LOCKSTEP_INLINE Lanes<S> at(Lanes<S> lanes, std::ptrdiff_t first, const Outline& o) {
  move(lanes, first, o);
  return lanes;
}

}  // namespace lockstep::kernels
