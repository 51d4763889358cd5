// What goes between a batch and a tile. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Read from the tables, or known when generated code is compiled: its loops over these are unrolled then.
struct TileShape {
  int joints;
  const int* dof;  ///< [joints]
  bool floating;
  std::uint32_t per_environment;
  bool record_impulses, record_diagnostics;
  bool consistent_is_shorter;  ///< load() looks whether all followers are consistent
  int pair_count;              ///< by these, if all followers have one leader each
  const Pair* pairs;
};

template <class S>
LOCKSTEP_INLINE TileShape tile_shape(const Tables<S>& t) {
  const Reduction<S>& r = t.reduction;
  return {t.joints,
          t.dof.data,
          t.floating,
          t.per_environment,
          t.record_impulses,
          t.record_diagnostics,
          r.consistent_is_shorter,
          r.consistent_is_shorter ? r.pairs.count : 0,
          r.pairs.data};
}

/// Moves on by so many environments.
template <class S>
LOCKSTEP_INLINE void move(StatePointers<S>& batch, std::ptrdiff_t by, const TileShape& o) {
  batch.position += by;
  batch.velocity += by;
  if (o.floating) batch.root_pose += by, batch.root_velocity += by;
  batch.position_target += by;
  batch.velocity_target += by;
  batch.effort += by;
  for (int f = 0; o.per_environment != 0 && f < parameter_count; ++f)
    if (batch.fields[f]) batch.fields[f] += by;
  if (o.record_impulses && batch.impulse) batch.impulse += by;
  if (o.record_diagnostics && batch.residual) batch.residual += by, batch.row_state += by;
  if (o.record_diagnostics) batch.energy += by;
  batch.fault += by;
}

/// The same lanes, moved to begin at environment `first`.
template <class S>
LOCKSTEP_INLINE StatePointers<S> at(StatePointers<S> batch, std::ptrdiff_t first, const TileShape& o) {
  move(batch, first, o);
  return batch;
}

}  // namespace lockstep::kernels
