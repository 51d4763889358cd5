// The followers of hard couplings eliminated: v = S z + w, A_r = S^T A S. SPDX-License-Identifier: Apache-2.0
//
// (M35) and (M36). Only scenes whose plan says `reduced` and that have hard couplings come here.
#pragma once

#include "ldlt.h"

namespace lockstep::kernels {

/// Sum of S's row of follower f over the solver's velocities z.
template <class T>
LOCKSTEP_INLINE T followed(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int f, const T* z) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  T sum = T(0);
  for (int s = r.start[f]; s < r.start[f + 1]; ++s) sum = fma(x.share[s], z[r.column[s]], sum);
  return sum;
}

/// y = S^T b
template <class T>
void collect(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* b, T* y) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const int root = t.velocities - t.joints;
  for (int z = 0; z < t.solver.n; ++z) y[z] = b[r.independent[z]];
  for (int f = 0; f < r.followers; ++f)
    for (int s = r.start[f]; s < r.start[f + 1]; ++s)
      y[r.column[s]] = fma(x.share[s], b[root + r.follower[f]], y[r.column[s]]);
}

/// y += A d and z = y - A w, for d and w that are zero but for the followers.
template <class T>
void add_follower_momentum(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* d, const T* w, T* y, T* z) {
  const Columns& columns = t.matrix;
  const int root = t.velocities - t.joints;
  for (int i = 0; i < t.velocities; ++i) z[i] = y[i];
  const auto add = [&](int i, T entry, T own_d, T own_w) {
    y[i] = fma(entry, own_d, y[i]);
    z[i] = fma(entry, own_d - own_w, z[i]);
  };
  for (int f = 0; f < t.reduction.followers; ++f) {
    const int i = root + t.reduction.follower[f];
    const T own_d = d[f], own_w = w[f];
    const T* own = x.matrix + columns.offset[i];
    for (int k = 0; k < columns.size[i]; ++k) add(i + k, own[k], own_d, own_w);
    for (int j = columns.parent[i]; j >= 0; j = columns.parent[j]) add(j, x.matrix[columns.offset[j] + i - j], own_d, own_w);
  }
}

/// A_r = S^T A S of (M36), as the sums of products that the plan listed.
template <class T>
void reduce_matrix(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const int* source = r.product_source.data;
  const int* first = r.product_start.data;
  if (!declared<T>(t, 0)) {
    const ScalarOf<T>* value = r.product_value.data;
    for (int e = 0; e < t.solver.entries; ++e) {
      T sum = T(0);
      for (int p = first[e], last = first[e + 1]; p < last; ++p) sum = fma(T(value[p]), x.matrix[source[p]], sum);
      x.reduced[e] = sum;
    }
    return;
  }
  for (int e = 0; e < t.solver.entries; ++e) {
    T sum = T(0);
    for (int p = first[e], last = first[e + 1]; p < last; ++p) {
      const int left = r.product_left[p], right = r.product_right[p];
      const T product = left < 0 ? x.matrix[source[p]] : x.share[left] * x.matrix[source[p]];
      sum = right < 0 ? sum + product : fma(x.share[right], product, sum);
    }
    x.reduced[e] = sum;
  }
}

/// A_r and the reduced forces: what a step starts from, what errors its followers have.
template <class T>
void eliminate(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Reduction<ScalarOf<T>>& r = t.reduction;
  const int root = t.velocities - t.joints;
  reduce_matrix(t, x);
  for (int z = 0; z < t.solver.n; ++z) x.start[z] = x.v[r.independent[z]];
  for (int f = 0; f < r.followers; ++f) {
    T correction = T(0);
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) {
      const int c = r.inverse_coupling[s];
      correction = fnma(x.inverse_form[s] * T(r.rate[c]), x.coupling_error[c], correction);
    }
    x.correction[f] = correction;
    x.mismatch[f] = x.v[root + r.follower[f]] - followed(t, x, f, x.start);
  }

  // S^T (dt forces + A mismatch) for velocities; positions are to be corrected as well.
  for (int i = 0; i < t.velocities; ++i) x.product[i] = x.drive[i];
  add_follower_momentum(t, x, x.mismatch, x.correction, x.product, x.corrected_product);
  if (t.solve_twice) collect(t, x, x.product, x.free_velocity);
  collect(t, x, x.corrected_product, x.free_position);
}

}  // namespace lockstep::kernels
