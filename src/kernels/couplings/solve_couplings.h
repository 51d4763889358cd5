// Solves the couplings that have rows, from the free velocity, by the plan's method.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "direct.h"
#include "pgs.h"
#include "tgs.h"

namespace lockstep::kernels {

/// Impulses and speeds of the couplings' rows.
template <class T>
void solve_couplings(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  responses(t, x);
  row_softness(t, batch, x);
  row_terms(t, x);
  switch (t.method) {
    case Method::pgs: pgs(t, x); break;
    case Method::tgs: tgs(t, x); break;
    default:  // direct, and what reduced leaves to solve
      factor_rows(t, x);
      direct(t, x);
  }
}

/// The speeds alone, as direct() leaves them, for plans whose rows are all hard and have constraint velocities (M79).
template <class T>
void known_constraint_velocities(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int r = 0; r < t.rows.count; ++r) {
    x.rows.speed[r] = -(T(t.rows.softness[r].rate) * x.couplings.error[t.rows.coupling[r]]);
    x.rows.velocity_phase_speed[r] = -T(0);
  }
}

}  // namespace lockstep::kernels
