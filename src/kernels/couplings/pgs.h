// Projected Gauss-Seidel: (16) of the note, with q and the biases fixed over the sweeps.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "sweep.h"

namespace lockstep::kernels {

template <class T>
void pgs(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  prepare_visits(rows, x);
  for (int r = 0; r < rows.count; ++r) begin_row(x, r);
  sweeps(rows, t.iterations, x);
  for (int r = 0; r < rows.count; ++r) {
    x.rows.position_impulse[r] = x.rows.impulse[r];
    x.rows.speed[r] = speed_of(x, r);
    change_bias(x, r, velocity_phase_bias(t, x, r));
  }
  sweeps(rows, t.velocity_iterations, x);
  for (int r = 0; r < rows.count; ++r) {
    x.rows.velocity_impulse[r] = x.rows.impulse[r];
    x.rows.velocity_phase_speed[r] = speed_of(x, r);
  }
}

}  // namespace lockstep::kernels
