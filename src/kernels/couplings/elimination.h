// Velocities in terms of those that are solved for: v = S z + w, A_r = S^T A S. SPDX-License-Identifier: Apache-2.0
//
// S eliminates the followers of hard couplings, (M39) and (M40), or has constraint velocities in their place (M77).
#pragma once

#include "consistent.h"
#include "kernels/dynamics/ldlt.h"

namespace lockstep::kernels {

/// Sums N products for each entry of a group, or as many as the group says if N is 0.
template <int N, class T>
LOCKSTEP_INLINE void sum_products(const Reduction<ScalarOf<T>>& r, const ProductGroup& group, const Tile<T>& x) {
  const int count = N > 0 ? N : group.count;
  const int* source = r.product_source.data + r.product_start[group.first];
  const ScalarOf<T>* value = r.product_value.data + r.product_start[group.first];
  for (int e = group.first; e < group.last; ++e, source += count, value += count) {
    T sum = T(0);
    for (int p = 0; p < count; ++p) sum = fma(T(value[p]), x.dynamics.matrix[source[p]], sum);
    x.dynamics.reduced[r.product_entry[e]] = sum;
  }
}

/// A_r = S^T A S of (M40), as sums of the products that the plan lists.
template <class T>
void reduce_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  if (!t.shares_differ()) {
    for (int g = 0; g < r.product_groups.count; ++g) {
      const ProductGroup& group = r.product_groups[g];
      switch (group.count) {
        case 1: sum_products<1>(r, group, x); break;
        case 2: sum_products<2>(r, group, x); break;
        case 3: sum_products<3>(r, group, x); break;
        case 4: sum_products<4>(r, group, x); break;
        default: sum_products<0>(r, group, x);
      }
    }
    return;
  }
  for (int e = 0; e < r.product_entry.count; ++e) {
    T sum = T(0);
    for (int p = r.product_start[e], last = r.product_start[e + 1]; p < last; ++p) {
      const T source = x.dynamics.matrix[r.product_source[p]];
      const int left = r.product_left[p], right = r.product_right[p];
      const T product = left < 0 ? source : x.couplings.share[left] * source;
      sum = right < 0 ? sum + product : fma(x.couplings.share[right], product, sum);
    }
    x.dynamics.reduced[r.product_entry[e]] = sum;
  }
}

/// S^T momentum, for one of the solver's velocities.
template <class T>
LOCKSTEP_INLINE T collected(const Reduction<ScalarOf<T>>& r, const Tile<T>& x, int z, const T* momentum) {
  T sum = momentum[r.independent[z]];
  for (int c = r.collect_start[z], last = r.collect_start[z + 1]; c < last; ++c)
    sum = fma(x.couplings.share[r.collected[c].value], momentum[r.collected[c].velocity], sum);
  return sum;
}

/// Adds A d, and A (d - w), to the forces, for trees whose A is computed. See reduce_forces().
template <class T>
LOCKSTEP_INLINE void add_removed_momentum(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const T *const matrix = x.dynamics.matrix, *const velocity_error = x.couplings.velocity_error;
  T *const corrected = x.dynamics.corrected_product, *const change = x.dynamics.scratch;
  const Momentum* const momenta = r.momentum.data;
  for (int f = 0; f < r.followers; ++f)
    change[f] = r.removes_by_force ? -x.couplings.correction[f] : velocity_error[f] - x.couplings.correction[f];
  for (int i = 0; i < t.velocities; ++i) {
    const int first = r.momentum_start[i], last = r.momentum_start[i + 1];
    T gained = x.dynamics.rhs[i], also_corrected = gained;
    for (int m = first; m < last; ++m) {
      const T entry = matrix[momenta[m].entry];
      also_corrected = fma(entry, change[momenta[m].follower], also_corrected);
      if (!r.removes_by_force) gained = fma(entry, velocity_error[momenta[m].follower], gained);
    }
    corrected[i] = also_corrected;
    if (!r.removes_by_force) x.dynamics.product[i] = gained;
  }
}

/// Momentum to gain (M40), with d for the velocity error: S^T (dt forces + A d) for the velocity phase, and S^T (dt
/// forces + A (d - w)) for the position phase. d and the correction w are zero except for followers. Where errors are
/// removed by force, A d is among the forces, and only A w is subtracted. Composite columns leave S^T A w behind A_r.
template <class T>
void reduce_forces(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const bool corrects = r.eliminates() && !(x.consistent && r.all_placed), twice = corrects && x.solves_twice;
  if (corrects && r.by_entries()) {
    add_removed_momentum(t, x);
    const T* const free = r.removes_by_force ? x.dynamics.rhs : x.dynamics.product;
    for (int z = 0; z < t.solver.n; ++z) {
      x.dynamics.half_solved_position[z] = collected(r, x, z, x.dynamics.corrected_product);
      if (twice) x.dynamics.half_solved_velocity[z] = collected(r, x, z, free);
    }
  } else {
    for (int z = 0; z < t.solver.n; ++z) {
      const T momentum = x.dynamics.half_solved_position[z] = collected(r, x, z, x.dynamics.rhs);
      if (twice) x.dynamics.half_solved_velocity[z] = momentum;
    }
  }
  if (!twice) return;
  for (int i = 0; i < r.composite.velocities.count; ++i)
    for (int z = r.composite.velocities[i].first; z < r.composite.velocities[i].last; ++z)
      x.dynamics.half_solved_position[z] =
          x.dynamics.half_solved_velocity[z] - x.dynamics.reduced[t.solver.entries + z];
}

/// w of (M39): the velocity that corrects follower f's error.
template <class T>
LOCKSTEP_INLINE T correcting_velocity(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  T correction = T(0);
  for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
    const int c = r.inverse_coupling[s];
    correction = fnma(x.couplings.follower_inverse[s] * T(r.rate[c]), x.couplings.error[c], correction);
  }
  return correction;
}

/// The velocities that a solve starts from where no follower is eliminated.
template <class T>
void start_velocities(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int z = 0; z < t.solver.n; ++z) x.dynamics.start[z] = x.state.v[r.independent[z]];
  for (int f = 0; f < r.followers; ++f)
    x.dynamics.start[r.constraint_velocity[f]] =
        x.state.v[t.velocity_of(r.follower[f])] - followed(t, x, f, x.dynamics.start);
}

/// The velocities that a solve starts from, and the errors and corrections of followers. Where errors are removed by
/// force, bias_forces() needs them.
template <class T>
void follow(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  for (int z = 0; z < t.solver.n; ++z) x.dynamics.start[z] = x.state.v[r.independent[z]];
  drop_rounding(t, x);
  const bool all_by_matrix = r.composite.places == 0, some_exact = r.exact.count > 0;
  for (int f = 0; f < r.followers; ++f) {
    const bool consistent = (x.consistent && r.placed[f]) || (some_exact && r.exact[f]);
    x.couplings.correction[f] = x.corrects_positions && !consistent ? correcting_velocity(t, x, f) : T(0);
    x.couplings.velocity_error[f] =
        consistent ? T(0) : x.state.v[t.velocity_of(r.follower[f])] - followed(t, x, f, x.dynamics.start);
    if (!r.removes_by_force) continue;
    const bool by_matrix =
        all_by_matrix || (r.by_entries() && t.tree_of_joint(r.follower[f]).inertia == InertiaKind::matrix);
    x.couplings.removed_this_step[f] = by_matrix || x.solves_twice
                                           ? x.couplings.velocity_error[f]
                                           : x.couplings.velocity_error[f] - x.couplings.correction[f];
    x.couplings.acceleration[f] = x.couplings.removed_this_step[f] * T(ScalarOf<T>(-1) / t.dt);
  }
}

}  // namespace lockstep::kernels
