// One matrix and several right-hand sides, for integrators with more than one stage.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "integrate.h"
#include "kernels/bounds/held_velocities.h"
#include "kernels/couplings/direct.h"
#include "kernels/couplings/free_velocity.h"

namespace lockstep::kernels {

/// The matrix of the stages, before a search of theirs changes it.
template <class T>
LOCKSTEP_INLINE void keep_diagonal(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  matrix_of_bodies(t, x);
  for (int k = 0; k < t.rounds.columns.n; ++k) x.midpoint.diagonal[k] = x.held.matrix[t.rounds.columns.offset[k]];
}

/// Exchanges the couplings' softness over a stage with that over the whole step, for a solve at the midpoint.
template <class T>
LOCKSTEP_INLINE void exchange_softness(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int r = 0; r < t.rows.count; ++r) {
    const T rate = x.rows.rate[r], cfm = x.rows.cfm[r];
    x.rows.rate[r] = x.midpoint.rate[r], x.rows.cfm[r] = x.midpoint.cfm[r];
    x.midpoint.rate[r] = rate, x.midpoint.cfm[r] = cfm;
  }
}

/// Factors A, and K of the couplings' rows. All solves with one matrix share this.
template <class T>
void factorise(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  if (t.undamped.count > 0) undamped_responses(t, x);
  if (t.reduction.by_entries()) reduce_matrix(t, x);
  if (t.rounds.used()) keep_matrix(t, x);
  if (t.rounds.at_midpoint) keep_diagonal(t, x);
  factor_matrix(t, x);
  if (t.rows.count == 0) return;
  responses(t, x);
  if (t.rounds.at_midpoint) {
    row_softness(*t.midpoint, batch, x);
    exchange_softness(t, x);
  }
  row_softness(t, batch, x);
  factor_rows(t, x);
}

/// Changes of the velocities from the forces in x.dynamics.rhs. A change as the difference of two velocities would
/// carry the rounding of both.
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
