// The motion without rows: A factored, its forces half solved. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ldlt.h"

namespace lockstep::kernels {

/// D^-1 L^-T b of (M18), in place.
template <class T>
void half_solve(const Columns& columns, const T* factored, const T* inverse, T* b) {
  solve_upwards(columns, factored, b);
  for (int z = 0; z < columns.n; ++z) b[z] *= inverse[z];
}

/// The free velocity is v* = v + L^-1 y with the y that this leaves in x.free_position and x.free_velocity:
/// the other half of the solve is done once, when the rows' impulses have been added (integrate.h).
template <class T>
void free_velocity(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Columns& columns = t.solver;
  x.singular = factor(columns, x.reduced, x.inverse, T(0), x.scratch);
  if (t.reduction.followers == 0)
    for (int z = 0; z < columns.n; ++z) {
      x.start[z] = x.v[z];
      x.free_position[z] = x.drive[z];
    }
  if (x.free_velocity == x.free_position) return half_solve(columns, x.reduced, x.inverse, x.free_position);
  solve_upwards(columns, x.reduced, x.free_position, x.free_velocity);
  for (int z = 0; z < columns.n; ++z) {
    x.free_position[z] *= x.inverse[z];
    x.free_velocity[z] *= x.inverse[z];
  }
}

}  // namespace lockstep::kernels
