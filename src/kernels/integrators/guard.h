// The guard: finds steps that are too coarse for the motion. SPDX-License-Identifier: Apache-2.0
//
// Section 20. A leapfrog step has two bias forces. What they differ by, as a share of the momentum, is eta. A lane above
// the limit takes its step in halves (leapfrog.h).
#pragma once

#include "kernels/bounds/stage_bounds.h"
#include "kernels/dynamics/bias_forces.h"
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

/// (M92): the square of eta.
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
  for (int z = 0; z < t.solver.n; ++z) v[z] = fma(inverse_gamma, x.guard.change[independent ? independent[z] : z], v[z]);
  const T end = form_of_matrix(t, x, v, y);
  x.guard.size = larger(start, end);
  return select(beyond(missed, T(0)), (T(t.step) * inverse_gamma) * missed / x.guard.size, T(0));
}

/// (M93): the same for the bias forces after a landing, which the stages do not have.
template <class T>
T squared_coarseness_of_landings(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const T first = first_landing(t, x);
  if (!any(less(first, T(1)) & x.bounds.candidate)) return T(0);
  T *const bias = x.guard.bias, *const b = x.guard.velocity;
  for (int k = 0; k < t.velocities; ++k) bias[k] = x.dynamics.bias[k];
  for (int j = 0; j < t.joints; ++j) x.state.q[j] = x.stages.midpoint.q[j];
  for (int k = 0; k < t.velocities; ++k) x.state.v[k] = x.next.v[k];
  bias_forces(t, batch, x);
  for (int k = 0; k < t.velocities; ++k) bias[k] = x.dynamics.bias[k] - bias[k];
  for (int z = 0; z < t.solver.n; ++z)
    b[z] = t.reduction.followers > 0 ? collected(t.reduction, x, z, bias) : bias[z];
  T missed = T(0);
  for (int r = 0; r < t.factored.count; ++r) solve_upwards(t.solver, t.factored[r], x.dynamics.reduced, b);
  for (int z = 0; z < t.solver.n; ++z) missed = fma(b[z] * b[z], x.dynamics.inverse[z], missed);
  const T time = T(t.step) * (T(1) - first);
  return select(less(first, T(1)) & x.bounds.candidate, time * time * missed / x.guard.size, T(0));
}

template <class T>
typename T::Mask is_coarse(const Tables<ScalarOf<T>>& t, const Tile<T>& x, T eta) {
  return ~less(eta, T(t.coarse_above)) & ~x.frozen;
}

/// After the stages: finds the lanes whose step is too coarse. NaN is.
template <class T>
void judge(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  x.guard.eta = squared_coarseness(t, x);
  if (t.bounds.by_velocity && x.stage_bounds.opened)
    x.guard.eta = farther(x.guard.eta, squared_coarseness_of_landings(t, batch, x));
  x.guard.coarse = is_coarse(t, x, x.guard.eta);
}

}  // namespace lockstep::kernels
