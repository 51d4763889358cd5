// The motion without rows: A factored, its forces half solved. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "elimination.h"

namespace lockstep::kernels {

/// D^-1 L^-T b of (M18), in place.
template <class T>
void half_solve(const Columns& columns, const T* factored, const T* inverse, T* b) {
  solve_upwards(columns, factored, b);
  for (int z = 0; z < columns.n; ++z) b[z] *= inverse[z];
}

/// A, or A_r, to its factors (M17).
template <class T>
void factor_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.singular = factor(t.solver, x.reduced, x.inverse, T(0));
}

/// The free velocity is v* = v + L^-1 y with the y that this leaves in x.free_position and x.free_velocity:
/// the other half of the solve is done once, when the rows' impulses have been added (integrate.h).
template <class T>
void free_velocity(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Columns& columns = t.solver;
  if (t.reduction.followers == 0)
    for (int z = 0; z < columns.n; ++z) {
      x.start[z] = x.v[z];
      x.free_position[z] = x.drive[z];
    }
  else
    reduce_forces(t, x);
  if (!x.solves_twice || x.free_velocity == x.free_position)
    return half_solve(columns, x.reduced, x.inverse, x.free_position);
  solve_upwards(columns, x.reduced, x.free_position, x.free_velocity);
  for (int z = 0; z < columns.n; ++z) {
    x.free_position[z] *= x.inverse[z];
    x.free_velocity[z] *= x.inverse[z];
  }
}

}  // namespace lockstep::kernels
