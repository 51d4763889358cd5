// The motion without rows: A factored, its forces half solved. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "articulated.h"
#include "elimination.h"

namespace lockstep::kernels {

/// A, or A_r, to its factors (M17), or A's from the bodies. An environment's own numbers may be infinite: such a pivot
/// is none either, and known by its inverse.
template <class T>
void factor_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.singular = t.articulated.used() ? factor_articulated(t, x) : factor(t.solver, x.reduced, x.inverse, T(0));
  for (int z = 0; t.per_environment != 0 && z < t.solver.n; ++z)
    x.singular = x.singular | less(x.inverse[z], least_pivot<T>());
}

/// The free velocity is v* = v + L^-1 y with the y that this leaves in x.free_position and x.free_velocity:
/// the other half of the solve is done once, when the rows' impulses have been added (integrate.h).
template <class T>
void free_velocity(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.free_velocity = x.in_place ? x.free_position : x.free_velocity_apart;  // in lists and generated code always apart
  const Columns& columns = t.solver;
  if (t.reduction.followers == 0)
    for (int z = 0; z < columns.n; ++z) {
      x.start[z] = x.v[z];
      x.free_position[z] = x.drive[z];
    }
  else
    reduce_forces(t, x);
  const bool twice = x.solves_twice && x.free_velocity != x.free_position;
  if (t.articulated.used())
    solve_inwards(t, x, t.articulated.all, x.free_position, 0);
  else if (twice)
    solve_upwards(columns, x.reduced, x.free_position, x.free_velocity);
  else
    solve_upwards(columns, x.reduced, x.free_position);
  for (int z = 0; z < columns.n; ++z) x.free_position[z] *= x.inverse[z];
  for (int z = 0; twice && z < columns.n; ++z) x.free_velocity[z] *= x.inverse[z];
}

}  // namespace lockstep::kernels
