// Temporal Gauss-Seidel: N sub-steps of one sweep, C renewed in each, A and r frozen. SPDX-License-Identifier: Apache-2.0
//
// (M35) to (M37). The free motion is shared out over the sub-steps; positions follow the mean of
// the sub-steps' velocities, so they see the mean of the running impulses.
#pragma once

#include "sweep.h"

namespace lockstep::kernels {

template <class T>
void tgs(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  using S = ScalarOf<T>;
  const Rows<S>& rows = t.rows;
  const T share = T(S(1) / S(t.iterations)), h = T(t.dt) * share;
  prepare_visits(rows, x);
  for (int r = 0; r < rows.count; ++r) {
    x.row_speed_closed[r] = (x.row_speed[r] - x.row_start[r]) * share;  // the free motion's part of a sub-step
    x.row_speed[r] = x.row_start[r];
    x.position_impulse[r] = x.velocity_impulse[r] = T(0);
  }
  T* const handed[] = {x.row_speed, x.row_bias, x.row_residual, x.row_impulse, x.velocity_impulse, x.position_impulse,
                       x.row_error};
  repeat(t.iterations, x, handed, rows.count, [&] {
    for (int r = 0; r < rows.count; ++r) {
      x.row_speed[r] += x.row_speed_closed[r];
      x.row_bias[r] = x.row_rate[r] * x.row_error[r];
      begin_row(x, r);
    }
    sweep(rows, x);
    for (int r = 0; r < rows.count; ++r) {
      x.row_speed[r] = speed_of(x, r);
      x.velocity_impulse[r] += x.row_impulse[r];
      x.position_impulse[r] = fma(share, x.velocity_impulse[r], x.position_impulse[r]);
      x.row_error[r] = fma(h, x.row_speed[r], x.row_error[r]);
    }
  });
  // Velocity iterations go on from the last sub-step's impulses, which the sum already holds.
  for (int r = 0; r < rows.count; ++r) {
    x.velocity_impulse[r] -= x.row_impulse[r];
    change_bias(x, r, closing_bias(x, r));
  }
  sweeps(rows, t.velocity_iterations, x);
  for (int r = 0; r < rows.count; ++r) x.velocity_impulse[r] += x.row_impulse[r];
}

}  // namespace lockstep::kernels
