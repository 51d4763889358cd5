// Last stage: writes the state of a tile to the batch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/contacts/memory.h"
#include "kernels/couplings/turns.h"
#include "kernels/tile/tile_shape.h"
#include "records.h"

namespace lockstep::kernels {

template <class T>
LOCKSTEP_INLINE void store(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x,
                           const TileShape& shape) {
  const T *const q = x.state.q, *const v = x.state.v;
  // Locals, or each store would make the compiler read these pointers again.
  ScalarOf<T>*const position = batch.position, *const velocity = batch.velocity;
  const std::ptrdiff_t stride = batch.stride;
  for (int j = 0; j < shape.joints; ++j) store(velocity + shape.dof[j] * stride, v[shape.velocity[j]]);
  if (t.turning.count > 0) {
    store_turns(t, batch, x);
    for (int r = 0; r < t.other_runs.count; ++r)
      for (int j = t.other_runs[r].first; j < t.other_runs[r].last; ++j) store(position + t.dof[j] * stride, q[j]);
  } else {
    for (int j = 0; j < shape.joints; ++j) store(position + shape.dof[j] * stride, q[j]);
  }
  for (int i = 0; i < 7 * shape.roots; ++i) store(batch.root_pose + i * stride, x.state.pose[i]);
  for (int r = 0; r < shape.roots; ++r)
    for (int i = 0; i < 6; ++i) store(batch.root_velocity + (6 * r + i) * stride, v[shape.root[r].velocity + i]);
  if (t.audited) {
    store(batch.audit, x.audit.state->gained);
    store(batch.audit + stride, x.audit.state->most);
  }
  if (t.contacts.used()) store_contacts(t, batch, x);
  if (t.records_calls()) store_records(t, batch, x);
  if (t.counts_solves()) store_counts(batch, x.counts);
  // Of the last step. A frozen environment took none, and is in no solve that others took.
  const auto store_if_stepped = [&](ScalarOf<T>* row, T number)
                                    LOCKSTEP_INLINED { store(row, select(x.frozen, T(0), number)); };
  for (int k = 0; k < 6 * t.loops.loops.count; ++k)
    store_if_stepped(batch.loop_force + k * batch.stride, x.loops.force[k]);
  for (int c = 0; shape.record_impulses && c < t.couplings; ++c)
    store_if_stepped(batch.impulse + c * batch.stride, x.couplings.impulse[c]);
  if (!shape.record_diagnostics) return;
  for (int r = 0; r < t.reported.count; ++r) {
    store_if_stepped(batch.residual + r * batch.stride, x.diagnostics.residual[r]);
    store_if_stepped(batch.row_state + r * batch.stride, x.diagnostics.row_state[r]);
  }
  for (int k = 0; k < 4; ++k) store(batch.energy + k * batch.stride, x.diagnostics.energy[k]);
}

template <class T>
void store(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, const Tile<T>& x) {
  store(t, batch, x, tile_shape(t));
}

}  // namespace lockstep::kernels
