// Temporal Gauss-Seidel: N sub-steps of one sweep, with C renewed in each, and constant A and r.
// SPDX-License-Identifier: Apache-2.0
//
// (M35) to (M37). Each sub-step gets a part of the free motion. Positions follow the mean of the sub-steps' velocities,
// so the mean of the running impulses moves them.
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
    x.rows.velocity_phase_speed[r] =
        (x.rows.speed[r] - x.rows.start[r]) * share;  // the free motion's part of a sub-step
    x.rows.speed[r] = x.rows.start[r];
    x.rows.position_impulse[r] = x.rows.velocity_impulse[r] = T(0);
  }
  T* const handed[] = {
      x.rows.speed, x.rows.bias, x.rows.residual, x.rows.impulse, x.rows.velocity_impulse, x.rows.position_impulse,
      x.rows.error};
  repeat(t.iterations, x, handed, rows.count, [&] {
    for (int r = 0; r < rows.count; ++r) {
      x.rows.speed[r] += x.rows.velocity_phase_speed[r];
      x.rows.bias[r] = x.rows.rate[r] * x.rows.error[r];
      begin_row(x, r);
    }
    sweep(rows, x);
    for (int r = 0; r < rows.count; ++r) {
      x.rows.speed[r] = speed_of(x, r);
      x.rows.velocity_impulse[r] += x.rows.impulse[r];
      x.rows.position_impulse[r] = fma(share, x.rows.velocity_impulse[r], x.rows.position_impulse[r]);
      x.rows.error[r] = fma(h, x.rows.speed[r], x.rows.error[r]);
    }
  });
  // Velocity iterations go on from the impulses of the last sub-step, which are already in the sum.
  for (int r = 0; r < rows.count; ++r) {
    x.rows.velocity_impulse[r] -= x.rows.impulse[r];
    change_bias(x, r, velocity_phase_bias(t, x, r));
  }
  sweeps(rows, t.velocity_iterations, x);
  for (int r = 0; r < rows.count; ++r) x.rows.velocity_impulse[r] += x.rows.impulse[r];
}

}  // namespace lockstep::kernels
