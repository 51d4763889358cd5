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
LOCKSTEP_INLINE void move(const Tables<S>& t, StatePointers<S>& batch, std::ptrdiff_t by) {
  each_block(
      t,
      [by](const BatchBlock&, auto& rows) LOCKSTEP_INLINED {
        if (rows) rows += by;
      },
      batch);
  if (!t.actuators.used()) return;
  for (const S*& rows : batch.shown_input)
    if (rows) rows += by;
  if (batch.shown_limit) batch.shown_limit += by;
}

/// The same pointers for the tile that begins at environment `first`.
template <class S>
LOCKSTEP_INLINE StatePointers<S> at(const Tables<S>& t, StatePointers<S> batch, std::ptrdiff_t first) {
  move(t, batch, first);
  return batch;
}

}  // namespace lockstep::kernels
