// The guard: finds steps that are too coarse for the motion. SPDX-License-Identifier: Apache-2.0
//
// Section 20. A leapfrog step has two bias forces. What they differ by, as a share of the momentum, is eta. A lane
// above the limit takes its step in halves (leapfrog.h).
#pragma once

#include "kernels/bounds/stage_bounds.h"
#include "kernels/couplings/free_velocity.h"
#include "kernels/dynamics/bias_forces.h"
#include "kernels/dynamics/kinematics.h"
#include "stage.h"

namespace lockstep::kernels {

/// v^T A v of the solver's velocities, by the factors of A.
template <class T>
LOCKSTEP_INLINE T form_of_matrix(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* v, T* y) {
  const Columns& columns = t.solver;
  for (int z = 0; z < columns.n; ++z) y[z] = v[z];
  if (t.articulated.used()) multiply_outwards(t, x, v, y);
  for (int r = 0; r < t.factored.count; ++r)
    for (int j = t.factored[r].first; j < t.factored[r].last; ++j) {
      const T* const own = x.dynamics.reduced + columns.offset[j];
      for (int k = 1, below = columns.size[j]; k < below; ++k) y[j + k] = fma(own[k], v[j], y[j + k]);
    }
  T sum = T(0);
  for (int z = 0; z < columns.n; ++z) sum = fma(y[z] * y[z], T(1) / x.dynamics.inverse[z], sum);
  return sum;
}

/// After the prediction: keeps what eta needs of it.
template <class T>
void keep_prediction(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int k = 0; k < t.velocities; ++k) {
    x.guard.bias[k] = x.dynamics.bias[k];
    x.guard.change[k] = x.stages.change[k];
  }
}

/// (M91): the square of eta.
template <class T>
T squared_coarseness(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  using S = ScalarOf<T>;
  const T inverse_gamma = T(S(1) / Alexander<S>::gamma);
  const int* const independent = t.reduction.followers > 0 ? t.reduction.independent.data : nullptr;
  T missed = T(0);
  for (int k = 0; k < t.velocities; ++k)
    missed = fma(x.dynamics.bias[k] - x.guard.bias[k], x.guard.change[k] - x.stages.change[k], missed);
  T *const v = x.guard.velocity, *const y = x.guard.product;
  for (int z = 0; z < t.solver.n; ++z) v[z] = x.stages.midpoint.v[independent ? independent[z] : z];
  const T start = form_of_matrix(t, x, v, y);
  for (int z = 0; z < t.solver.n; ++z)
    v[z] = fma(inverse_gamma, x.guard.change[independent ? independent[z] : z], v[z]);
  const T end = form_of_matrix(t, x, v, y);
  x.guard.size = larger(start, end);
  return select(beyond(missed, T(0)), (T(t.step) * inverse_gamma) * missed / x.guard.size, T(0));
}

/// The square of what the bias forces have changed since x.guard.bias, in a time, relative to the momentum.
template <class T>
T squared_change_of_bias(const Tables<ScalarOf<T>>& t, Tile<T>& x, T time) {
  T *const change = x.guard.bias, *const b = x.dynamics.half_solved_position;
  for (int k = 0; k < t.velocities; ++k) change[k] = x.dynamics.bias[k] - change[k];
  for (int z = 0; z < t.solver.n; ++z)
    b[z] = t.reduction.followers > 0 ? collected(t.reduction, x, z, change) : change[z];
  x.dynamics.half_solved_velocity = b;
  half_solve(t, x);
  T square = T(0);
  for (int z = 0; z < t.solver.n; ++z) square = fma(b[z] * b[z], T(1) / x.dynamics.inverse[z], square);
  return select(beyond(square, T(0)), time * time * square / x.guard.size, T(0));
}

/// (M92): eta with the bias forces after a landing, which the stages do not have, by the share of the step after which
/// the first row has landed.
template <class T>
T squared_coarseness_of_landings(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, T first,
                                 Tile<T>& x) {
  for (int k = 0; k < t.velocities; ++k) x.guard.bias[k] = x.dynamics.bias[k];
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < t.velocities; ++k) x.state.v[k] = x.next.v[k];
  bias_forces(t, batch, x);
  return squared_change_of_bias(t, x, T(t.step) * (T(1) - first));
}

/// Lanes in which a joint turns so far in the step that bias forces may depend on where in the step they are taken.
template <class T>
typename T::Mask turns_far(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  return beyond(farthest(x.next.v, t.velocities, farthest(x.stages.begin.v, t.velocities, T(0))),
                T(ScalarOf<T>(5) * t.fast_above));
}

/// (M92): eta with the bias forces at the positions where the step began.
template <class T>
T squared_coarseness_of_turns(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < t.velocities; ++k)
    x.state.v[k] = fma(T(ScalarOf<T>(0.5) / Alexander<ScalarOf<T>>::gamma), x.guard.change[k], x.stages.midpoint.v[k]);
  bias_forces(t, batch, x);
  for (int k = 0; k < t.velocities; ++k) x.guard.bias[k] = x.dynamics.bias[k];
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.begin.q[j];
  kinematics(t, x);
  bias_forces(t, batch, x);
  return squared_change_of_bias(t, x, T(t.step));
}

template <class T>
typename T::Mask is_coarse(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T eta) {
  return ~less(eta, T(t.coarse_above)) & ~x.frozen;
}

/// After the stages: finds the lanes whose step is too coarse. NaN is.
template <class T>
void judge(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.guard.eta = squared_coarseness(t, x);
  if (t.rounds.at_midpoint && any(x.midpoint.predicted))
    x.guard.eta = select(x.midpoint.predicted, squared_change_of_bias(t, x, T(t.step)), x.guard.eta);
  const auto take_larger = [&](typename T::Mask lanes, T eta) {
    x.guard.eta = farther(x.guard.eta, select(lanes, eta, T(0)));
  };
  if (t.rounds.in_stages)
    when(x, x.stage_bounds.opened, [&] {
      const T first = first_landing(t, x);
      const auto landed = less(first, T(1)) & x.bounds.candidate;
      when(x, landed, [&] { take_larger(landed, squared_coarseness_of_landings(t, batch, first, x)); });
    });
  const auto far = turns_far(t, x) & ~x.frozen;
  when(x, far, [&] { take_larger(far, squared_coarseness_of_turns(t, batch, x)); });
  x.guard.coarse = is_coarse(t, x, x.guard.eta);
}

/// Lanes that keep the leapfrog that has been judged, and are not only stepped beside others.
template <class T>
typename T::Mask keeping_lanes(const Tables<ScalarOf<T>>& t, const Tile<T>& x) {
  if (!t.guarded) return ~T::none();
  return t.half ? x.guard.halved & ~x.guard.coarse : x.guard.halved;
}

}  // namespace lockstep::kernels
