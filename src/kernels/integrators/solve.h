// A matrix and several right-hand sides: what integrators with more than one stage solve. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "integrate.h"
#include "kernels/couplings/direct.h"
#include "kernels/couplings/free_velocity.h"

namespace lockstep::kernels {

/// A, and K of the couplings' rows, to their factors: as much of the work as all solves with one matrix share.
template <class T>
void factorise(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.undamped.count > 0) undamped_responses(t, x);
  if (t.reduction.by_entries()) reduce_matrix(t, x);
  factor_matrix(t, x);
  if (t.rows.count == 0) return;
  responses(t, x);
  row_softness(t, batch, x);
  factor_rows(t, x);
}

/// The forces in x.dynamics.rhs to changes of the velocities. Not to velocities: a difference of two would carry the
/// rounding of either.
template <class T>
void solve(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  free_velocity(t, x);
  if (t.rows.count > 0) {
    row_terms(t, x);
    direct(t, x);
  }
  solved_changes(t, x);
}

}  // namespace lockstep::kernels
