// The linear algebra of a step: matrices to their factors, forces to velocities. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "direct.h"
#include "free_velocity.h"
#include "integrate.h"
#include "pgs.h"
#include "tgs.h"

namespace lockstep::kernels {

/// A, and K of the rows, to their factors: as much of the work as all solves with one matrix share.
template <class T>
void factorise(const Tables<ScalarOf<T>>& t, const Lanes<ScalarOf<T>>& lanes, Tile<T>& x) {
  if (t.natural.count > 0) natural_responses(t, x);
  if (t.reduction.followers > 0) reduce_matrix(t, x);
  factor_matrix(t, x);
  if (t.rows.count == 0) return;
  responses(t, x);
  row_softness(t, lanes, x);
  if (t.rows.columns.n > 0) factor_rows(t, x);
}

/// The forces in x.drive to velocities: free ones, then those that the couplings leave.
template <class T>
void solve(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  free_velocity(t, x);
  if (t.rows.count > 0) {
    row_terms(t, x);
    switch (t.method) {
      case method_pgs: pgs(t, x); break;
      case method_tgs: tgs(t, x); break;
      default: direct(t, x); break;  // direct, and what reduced leaves to solve
    }
  }
  solved_velocities(t, x);
}

}  // namespace lockstep::kernels
