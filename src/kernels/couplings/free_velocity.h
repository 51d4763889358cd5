// The motion without rows: factors A and half-solves for the forces. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "elimination.h"
#include "kernels/dynamics/articulated.h"

namespace lockstep::kernels {

/// Factors A or A_r (M17), trees with articulated bodies by these. Parameters per environment may be infinite. An
/// infinite pivot is no pivot either, and its inverse shows it.
template <class T>
void factor_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.singular = t.articulated.used() ? factor_articulated(t, x) : T::none();
  for (int r = 0; r < t.factored.count; ++r)
    x.singular = x.singular | factor(t.solver, t.factored[r], x.dynamics.reduced, x.dynamics.inverse, T(0));
  for (int z = 0; t.per_environment != 0 && z < t.solver.n; ++z)
    x.singular = x.singular | less(x.dynamics.inverse[z], least_pivot<T>());
}

/// Both phases have the same momenta where no follower needs a correction. A traced step always keeps the two arrays
/// apart.
template <class T>
LOCKSTEP_INLINE void share_momenta(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  x.dynamics.half_solved_velocity = x.consistent && t.reduction.all_placed ? x.dynamics.half_solved_position
                                                                           : x.dynamics.half_solved_velocity_storage;
}

/// The momentum to gain, in x.dynamics.half_solved_position and x.dynamics.half_solved_velocity.
template <class T>
LOCKSTEP_INLINE void momenta_to_gain(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  if (!t.reduction.used())
    for (int z = 0; z < t.solver.n; ++z) {
      x.dynamics.start[z] = x.state.v[z];
      x.dynamics.half_solved_position[z] = x.dynamics.rhs[z];
    }
  else
    reduce_forces(t, x);
}

/// Leaves y of (M18) in their place. The other half of the solve is done once, after the rows' impulses have been added
/// (integrate.h).
template <class T>
LOCKSTEP_INLINE void half_solve(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Columns& columns = t.solver;
  const bool twice = x.solves_twice && x.dynamics.half_solved_velocity != x.dynamics.half_solved_position;
  if (t.articulated.used()) {
    solve_inwards(t, x, t.articulated.all, x.dynamics.half_solved_position, 0);
    if (twice) solve_inwards(t, x, t.articulated.all, x.dynamics.half_solved_velocity, 0);
  }
  for (int r = 0; r < t.factored.count; ++r) {
    const SupportRun run = t.factored[r];
    if (twice)
      solve_upwards(columns, run, x.dynamics.reduced, x.dynamics.half_solved_position, x.dynamics.half_solved_velocity);
    else
      solve_upwards(columns, run, x.dynamics.reduced, x.dynamics.half_solved_position);
  }
  for (int z = 0; z < columns.n; ++z) x.dynamics.half_solved_position[z] *= x.dynamics.inverse[z];
  for (int z = 0; twice && z < columns.n; ++z) x.dynamics.half_solved_velocity[z] *= x.dynamics.inverse[z];
}

template <class T>
void free_velocity(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  share_momenta(t, x);
  momenta_to_gain(t, x);
  half_solve(t, x);
}

}  // namespace lockstep::kernels
