// The stages of a leapfrog step: a diagonally implicit Runge-Kutta method for the linear terms (M68), (M69).
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/couplings/coupling_error.h"
#include "kernels/couplings/joint_terms.h"
#include "solve.h"

namespace lockstep::kernels {

/// Coefficients of (M69).
template <class S>
struct Alexander {
  static constexpr double g = alexander_gamma;
  static constexpr S gamma = S(g);
  static constexpr S time[leapfrog_stages] = {S(g), S((1 + g) / 2), S(1)};
  static constexpr S weight[leapfrog_stages] = {S(-(6 * g * g - 16 * g + 1) / 4), S((6 * g * g - 20 * g + 5) / 4),
                                                S(g)};
  /// a_ik, k < i
  static constexpr S before[leapfrog_stages][2] = {{S(0), S(0)}, {S((1 - g) / 2), S(0)}, {weight[0], weight[1]}};
};

/// Brings x.state to the beginning of stage i of (M68), from x.stages.begin.q, x.stages.midpoint.v and the earlier
/// stages, and computes the forces.
template <class T>
void begin_stage(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int i, int time) {
  using S = ScalarOf<T>;
  using A = Alexander<S>;
  const int n = t.velocities;
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.begin.q[j];
  for (int k = 0; k < n; ++k) x.state.v[k] = x.stages.midpoint.v[k];
  for (int earlier = 0; earlier < i; ++earlier) {
    const T duration = T(t.step * A::before[i][earlier]), share = T(A::before[i][earlier] / A::gamma);
    for (int j = 0; j < t.joints; ++j)
      x.state.q[j] = fma(duration, x.stages.velocity[earlier * n + t.velocity_of(j)], x.state.q[j]);
    for (int k = 0; k < n; ++k) x.state.v[k] = fma(share, x.stages.change[earlier * n + k], x.state.v[k]);
  }
  if (t.balls.count > 0) turn_along_ways(t, x.stages.begin.q, x.state.q);
  const bool last = i == leapfrog_stages - 1;
  x.corrects_positions = last;
  x.solves_twice = last && t.solve_twice;
  if (t.rows.count > 0 || (last && t.couplings > 0)) coupling_errors(t, x);
  if (t.reduction.followers > 0) follow(t, x);
  joint_forces(t, batch, x, time + i);
}

/// One stage of (M68) without bounds.
template <class T>
void stage(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x, int i, int time) {
  const int n = t.velocities;
  begin_stage(t, batch, x, i, time);
  solve(t, x);
  T *change = x.stages.change + i * n, *velocity = x.stages.velocity + i * n;
  expand_changes(t, x, x.dynamics.solution, change);
  for (int k = 0; k < n; ++k) velocity[k] = changed_by(x.state.v[k], change[k]);
  for (int f = 0; x.corrects_positions && f < t.reduction.followers; ++f)
    velocity[t.velocity_of(t.reduction.follower[f])] += x.couplings.correction[f];
  if (x.solves_twice) expand_changes(t, x, x.dynamics.velocity_solution, change);
}

}  // namespace lockstep::kernels
