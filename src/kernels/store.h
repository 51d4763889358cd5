// Last stage: the tile's state back into the batch's rows. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "outline.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE void store(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, const Tile<T>& x,
                           const Outline& o) {
  const T *const q = x.q, *const v = o.floating ? x.v + 6 : x.v;
  ScalarOf<T> *const position = lanes.position, *const velocity = lanes.velocity;  // not read again after each store
  const std::ptrdiff_t stride = lanes.stride;
  for (int j = 0; j < o.joints; ++j) {
    store(position + o.joint_row[j] * stride, q[j]);
    store(velocity + o.joint_row[j] * stride, v[j]);
  }
  for (int i = 0; o.floating && i < 7; ++i) store(lanes.root_pose + i * lanes.stride, x.root_pose[i]);
  for (int i = 0; o.floating && i < 6; ++i) store(lanes.root_velocity + i * lanes.stride, x.v[i]);
  for (int c = 0; o.record_impulses && c < t.couplings; ++c) store(lanes.impulse + c * lanes.stride, x.impulse[c]);
  if (!o.record_diagnostics) return;
  for (int r = 0; r < t.reported.count; ++r) {
    store(lanes.residual + r * lanes.stride, x.residual[r]);
    store(lanes.row_state + r * lanes.stride, x.row_state[r]);
  }
  for (int k = 0; k < 4; ++k) store(lanes.energy + k * lanes.stride, x.energy[k]);
}

template <class T>
void store(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, const Tile<T>& x) {
  store(t, lanes, x, outline(t));
}

}  // namespace lockstep::kernels
