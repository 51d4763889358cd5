// Last stage: the tile's state back into the batch's rows. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile_shape.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE void store(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                           const TileShape& o) {
  const T *const q = x.state.q, *const v = o.floating ? x.state.v + 6 : x.state.v;
  ScalarOf<T>*const position = batch.position, *const velocity = batch.velocity;  // not read again after each store
  const std::ptrdiff_t stride = batch.stride;
  for (int j = 0; j < o.joints; ++j) {
    store(position + o.dof[j] * stride, q[j]);
    store(velocity + o.dof[j] * stride, v[j]);
  }
  for (int i = 0; o.floating && i < 7; ++i) store(batch.root_pose + i * batch.stride, x.state.pose[i]);
  for (int i = 0; o.floating && i < 6; ++i) store(batch.root_velocity + i * batch.stride, x.state.v[i]);
  for (int c = 0; o.record_impulses && c < t.couplings; ++c)
    store(batch.impulse + c * batch.stride, x.couplings.impulse[c]);
  if (!o.record_diagnostics) return;
  for (int r = 0; r < t.reported.count; ++r) {
    store(batch.residual + r * batch.stride, x.diagnostics.residual[r]);
    store(batch.row_state + r * batch.stride, x.diagnostics.row_state[r]);
  }
  for (int k = 0; k < 4; ++k) store(batch.energy + k * batch.stride, x.diagnostics.energy[k]);
}

template <class T>
void store(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  store(t, batch, x, tile_shape(t));
}

}  // namespace lockstep::kernels
