// Sparse H = L^T D L (M17) and its solves (Featherstone 2008, section 6.5). SPDX-License-Identifier: Apache-2.0
//
// Column j holds the rows of j's subtree, which are contiguous (plan/tables.h). So every inner loop below runs through
// one or two arrays. There is no fill-in, because elimination goes from the leaves to the root.
#pragma once

#include "kernels/tile/tile.h"

namespace lockstep::kernels {

/// start - a . b. Long ones are four sums, which need not wait for each other.
template <class T>
LOCKSTEP_INLINE T subtract_dot(const T* a, const T* b, int count, T start) {
  if (count < 4) {
    for (int k = 0; k < count; ++k) start = fnma(a[k], b[k], start);
    return start;
  }
  T second = T(0), third = T(0), fourth = T(0);
  int k = 0;
  for (; k + 4 <= count; k += 4) {
    start = fnma(a[k], b[k], start);
    second = fnma(a[k + 1], b[k + 1], second);
    third = fnma(a[k + 2], b[k + 2], third);
    fourth = fnma(a[k + 3], b[k + 3], fourth);
  }
  for (; k < count; ++k) start = fnma(a[k], b[k], start);
  return (start + second) + (third + fourth);
}

/// Scales the entries below a column's diagonal by their inverse pivots. Returns what is left of the diagonal.
template <class T>
LOCKSTEP_INLINE T scale_column(T* own, const T* inverse, int count) {
  T sum[4] = {own[0], T(0), T(0), T(0)};
  const auto scale = [&](int k, T& part) LOCKSTEP_INLINED {
    const T entry = own[k];
    own[k] = entry * inverse[k];
    part = fnma(own[k], entry, part);
  };
  int k = 1;
  for (; k + 4 <= count; k += 4)
    for (int n = 0; n < 4; ++n) scale(k + n, sum[n]);
  for (; k < count; ++k) scale(k, sum[0]);
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/// For N entries of the matrix: subtracts own . (what follows the entry), both from index 1 on.
template <int N, class T>
LOCKSTEP_INLINE void subtract_dots(const T* own, T* matrix, const int* entry, int count) {
  T* above[N];
  T sum[N];
  for (int n = 0; n < N; ++n) above[n] = matrix + entry[n], sum[n] = above[n][0];
  for (int k = 1; k < count; ++k) {
    const T factor = own[k];
    for (int n = 0; n < N; ++n) sum[n] = fnma(factor, above[n][k], sum[n]);
  }
  for (int n = 0; n < N; ++n) above[n][0] = sum[n];
}

/// The smallest pivot whose inverse is finite in single precision. Both precisions take this one, because a step is
/// traced once for both.
template <class T>
LOCKSTEP_INLINE T least_pivot() {
  return T(ScalarOf<T>(0x1p-126));
}

/// 1 / pivot. Where the pivot is below `least`, the inverse is zero, so its unknown becomes zero, and `weak` is set.
/// NaN stays NaN, for check() to find.
template <class T>
LOCKSTEP_INLINE T inverse_of(T pivot, T least, typename T::Mask& weak) {
  const typename T::Mask too_small = less(pivot, least);
  weak = weak | too_small;
  return select(too_small, T(0), T(1) / pivot);
}

/// Row i of every ancestor's column, eight ancestors at a time, whose sums need not wait for each other: subtracts the
/// products with column i, whose entries below the diagonal are scaled.
template <class T>
LOCKSTEP_INLINE void subtract_from_ancestors(const Columns& columns, int i, const T* own, T* matrix) {
  const int* const row = columns.row.data;
  const int below = columns.size[i], last = columns.row_start[i + 1];
  int a = columns.row_start[i];
  for (; a + 8 <= last; a += 8) subtract_dots<8>(own, matrix, row + a, below);
  if (a + 4 <= last) subtract_dots<4>(own, matrix, row + a, below), a += 4;
  if (a + 2 <= last) subtract_dots<2>(own, matrix, row + a, below), a += 2;
  if (a < last) matrix[row[a]] = subtract_dot(own + 1, matrix + row[a] + 1, below - 1, matrix[row[a]]);
}

/// All rows and columns.
LOCKSTEP_INLINE SupportRun all_of(const Columns& columns) { return {0, columns.n}; }

/// The columns of `run`, which are whole trees. H becomes L below the diagonal, and inverse = 1 / D. A pivot is too
/// small if it is below `tolerance` times its own diagonal before, plus least_pivot(). Returns the lanes that have such
/// a pivot.
template <class T>
typename T::Mask factor(const Columns& columns, SupportRun run, T* matrix, T* inverse, T tolerance) {
  typename T::Mask weak = T::none();
  for (int i = run.last - 1; i >= run.first; --i) {
    T* own = matrix + columns.offset[i];
    const int below = columns.size[i];
    const T least = fma(tolerance, own[0], least_pivot<T>());
    const T pivot = own[0] = scale_column(own, inverse + i, below);
    inverse[i] = inverse_of(pivot, least, weak);
    subtract_from_ancestors(columns, i, own, matrix);
  }
  return weak;
}

/// b <- L^-T b
template <class T>
void solve_upwards(const Columns& columns, SupportRun run, const T* factor, T* b) {
  for (int j = run.last - 1; j >= run.first; --j)
    b[j] = subtract_dot(factor + columns.offset[j] + 1, b + j + 1, columns.size[j] - 1, b[j]);
}

/// The same for two right-hand sides at once. Each gets the same bits as by itself.
template <class T>
void solve_upwards(const Columns& columns, SupportRun run, const T* factor, T* a, T* b) {
  for (int j = run.last - 1; j >= run.first; --j) {
    const T* const own = factor + columns.offset[j] + 1;
    const int below = columns.size[j] - 1;
    a[j] = subtract_dot(own, a + j + 1, below, a[j]);
    b[j] = subtract_dot(own, b + j + 1, below, b[j]);
  }
}

struct NoneKnown {
  LOCKSTEP_INLINE void operator()(int) const {}
};

/// b <- L^-1 b. know(j) is called before b[j] is used, and may set it to a known value.
template <class T, class Know = NoneKnown>
void solve_downwards(const Columns& columns, SupportRun run, const T* factor, T* b, Know&& know = {}) {
  for (int j = run.first; j < run.last; ++j) {
    know(j);
    const T* own = factor + columns.offset[j];
    const T value = b[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) b[j + k] = fnma(own[k], value, b[j + k]);
  }
}

/// The same for two right-hand sides at once.
template <class T, class Know = NoneKnown>
void solve_downwards(const Columns& columns, SupportRun run, const T* factor, T* a, T* b, Know&& know = {}) {
  for (int j = run.first; j < run.last; ++j) {
    know(j);
    const T* const own = factor + columns.offset[j];
    const T first = a[j], second = b[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) {
      const T entry = own[k];
      a[j + k] = fnma(entry, first, a[j + k]);
      b[j + k] = fnma(entry, second, b[j + k]);
    }
  }
}

}  // namespace lockstep::kernels
