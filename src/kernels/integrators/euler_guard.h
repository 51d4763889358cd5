// The guard of semi-implicit Euler. SPDX-License-Identifier: Apache-2.0
//
// (M94). Euler has one bias force, so eta takes a second one, at the mean of the velocities before and after the step.
// Only lanes where a joint turns far in the step pay for it.
#pragma once

#include "guard.h"
#include "kernels/couplings/free_velocity.h"
#include "kernels/couplings/joint_terms.h"
#include "kernels/dynamics/kinematics.h"

namespace lockstep::kernels {

/// The solver's velocities of all velocities `v`.
template <class T>
void solver_velocities(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* v, T* z) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int i = 0; i < t.solver.n; ++i) z[i] = v[r.followers > 0 ? r.independent[i] : i];
  if (!r.has_constraint_velocities()) return;
  for (int f = 0; f < r.followers; ++f)
    z[r.constraint_velocity[f]] = v[t.velocity_of(r.follower[f])] - followed(t, x, f, z);
}

/// (M94): sets x.too_fast, from x.state and the velocities x.next.v. Leaves nothing else as it was.
template <class T>
void judge_euler(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  using S = ScalarOf<T>;
  const int n = t.solver.n;
  kinematics(t, x);
  for (int f = 0; t.reduction.removes_by_force && f < t.reduction.followers; ++f) x.couplings.acceleration[f] = T(0);
  bias_forces(t, batch, x);
  for (int k = 0; k < t.velocities; ++k) x.guard.bias[k] = x.dynamics.bias[k];
  for (int k = 0; k < t.velocities; ++k) {
    x.guard.change[k] = x.state.v[k];
    x.state.v[k] = T(S(0.5)) * (x.state.v[k] + x.next.v[k]);
  }
  bias_forces(t, batch, x);
  for (int k = 0; k < t.velocities; ++k) {
    x.state.v[k] = x.guard.change[k];
    x.guard.bias[k] = x.dynamics.bias[k] - x.guard.bias[k];
  }
  joint_inertias(t, batch, x);
  inertia_matrix(t, batch, x);
  if (t.reduction.by_entries()) reduce_matrix(t, x);
  const auto singular = x.singular;
  factor_matrix(t, x);
  x.singular = singular;
  T* const missed = x.dynamics.half_solved_position;
  for (int z = 0; z < n; ++z)
    missed[z] = t.reduction.followers > 0 ? collected(t.reduction, x, z, x.guard.bias) : x.guard.bias[z];
  x.dynamics.half_solved_velocity = missed;
  half_solve(t, x);
  T square = T(0);
  for (int z = 0; z < n; ++z) square = fma(missed[z] * missed[z], T(1) / x.dynamics.inverse[z], square);
  solver_velocities(t, x, x.state.v, x.guard.velocity);
  const T start = form_of_matrix(t, x, x.guard.velocity, x.guard.product);
  solver_velocities(t, x, x.next.v, x.guard.velocity);
  const T end = form_of_matrix(t, x, x.guard.velocity, x.guard.product);
  const T eta = select(beyond(square, T(0)), T(t.dt * t.dt) * square / larger(start, end), T(0));
  x.too_fast = ~less(eta, T(t.too_fast_above)) & x.guard.coarse;
}

/// Judges the step in lanes where a velocity is large.
template <class T>
LOCKSTEP_INLINE void guard_euler(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.too_fast = T::none();
  x.guard.coarse = beyond(farthest(x.next.v, t.velocities, T(0)), T(t.fast_above)) & ~x.frozen;
  if (any(x.guard.coarse)) judge_euler(t, batch, x);
}

}  // namespace lockstep::kernels
