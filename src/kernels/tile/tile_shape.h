// TileShape: what a batch and a tile exchange. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// Read from the tables. Generated code knows it when compiled, so its loops over joints and pairs are unrolled.
struct TileShape {
  int joints;
  const int *dof, *velocity;  ///< [joints]
  int roots;
  const FloatingRoot* root;  ///< [roots]
  std::uint32_t per_environment;
  bool record_impulses, record_diagnostics;
  bool consistent_is_shorter;  ///< load() tests whether all followers are consistent
  int pair_count;              ///< pairs to test, if each follower has one leader
  const Pair* pairs;
};

template <class S>
LOCKSTEP_INLINE TileShape tile_shape(const Tables<S>& t) {
  const Reduction<S>& r = t.reduction;
  return {t.joints,
          t.dof.data,
          t.joint_velocity.data,
          t.roots.count,
          t.roots.data,
          t.per_environment,
          t.record_impulses,
          t.record_diagnostics,
          r.consistent_is_shorter,
          r.consistent_is_shorter ? r.pairs.count : 0,
          r.pairs.data};
}

/// Moves all pointers `by` environments onwards.
template <class S>
LOCKSTEP_INLINE void move(StatePointers<S>& batch, std::ptrdiff_t by, const TileShape& shape) {
  batch.position += by;
  batch.velocity += by;
  if (batch.angle) batch.angle += by;
  if (shape.roots > 0) batch.root_pose += by, batch.root_velocity += by;
  batch.position_target += by;
  batch.velocity_target += by;
  batch.effort += by;
  for (int f = 0; shape.per_environment != 0 && f < parameter_count; ++f)
    if (batch.fields[f]) batch.fields[f] += by;
  if (shape.record_impulses && batch.impulse) batch.impulse += by;
  if (shape.record_diagnostics && batch.residual) batch.residual += by, batch.row_state += by;
  if (shape.record_diagnostics) batch.energy += by;
  if (batch.audit) batch.audit += by;
  if (batch.contact_memory) batch.contact_memory += by;
  batch.fault += by;
  batch.place += by, batch.steps += by;
}

/// The same pointers for the tile that begins at environment `first`.
template <class S>
LOCKSTEP_INLINE StatePointers<S> at(StatePointers<S> batch, std::ptrdiff_t first, const TileShape& shape) {
  move(batch, first, shape);
  return batch;
}

}  // namespace lockstep::kernels
