// Sparse H = L^T D L (M17) and its solves (Featherstone 2008, section 6.5). SPDX-License-Identifier: Apache-2.0
//
// Column j holds the rows of j's subtree, a contiguous run (plan/tables.h), so every inner loop below is a
// run through one or two arrays. No fill-in: eliminating from the leaves to the root stays in the tree.
#pragma once

#include "tile.h"

namespace lockstep::kernels {

/// start - a . b, in four sums that need not wait for each other where it is long enough to matter.
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

/// H becomes L below the diagonal; inverse = 1 / D. A pivot not above `tolerance` times the diagonal that it
/// came from is taken for none: its inverse is 0, so that its unknown is 0. Returns the lanes where that happened.
/// What is no number stays none, for check() to find. `scaled` is room for n numbers.
template <class T>
typename T::Mask factor(const Columns& columns, T* matrix, T* inverse, T tolerance, T* scaled) {
  typename T::Mask weak = T::none();
  for (int i = columns.n - 1; i >= 0; --i) {
    T* own = matrix + columns.offset[i];
    const int below = columns.size[i];
    const T least = tolerance * own[0];
    for (int k = 1; k < below; ++k) scaled[k] = own[k] * inverse[i + k];
    const T pivot = subtract_dot(scaled + 1, own + 1, below - 1, own[0]);
    for (int k = 1; k < below; ++k) own[k] = scaled[k];
    own[0] = pivot;
    const typename T::Mask good = less(least, pivot) | beyond(pivot, T(ScalarOf<T>(__builtin_inf())));
    inverse[i] = select(good, T(1) / pivot, T(0));
    weak = weak | ~good;
    // Row i of every ancestor's column, four ancestors at a time.
    int j = columns.parent[i];
    while (j >= 0) {
      T* above[4];
      int count = 0;
      for (; count < 4 && j >= 0; j = columns.parent[j]) above[count++] = matrix + columns.offset[j] + (i - j);
      if (count == 4) {
        T a = above[0][0], b = above[1][0], c = above[2][0], d = above[3][0];
        for (int k = 1; k < below; ++k) {
          a = fnma(own[k], above[0][k], a);
          b = fnma(own[k], above[1][k], b);
          c = fnma(own[k], above[2][k], c);
          d = fnma(own[k], above[3][k], d);
        }
        above[0][0] = a, above[1][0] = b, above[2][0] = c, above[3][0] = d;
        continue;
      }
      for (int n = 0; n < count; ++n) above[n][0] = subtract_dot(own + 1, above[n] + 1, below - 1, above[n][0]);
    }
  }
  return weak;
}

/// b <- L^-T b
template <class T>
void solve_upwards(const Columns& columns, const T* factor, T* b) {
  for (int j = columns.n - 1; j >= 0; --j)
    b[j] = subtract_dot(factor + columns.offset[j] + 1, b + j + 1, columns.size[j] - 1, b[j]);
}

/// The same for two right-hand sides at once.
template <class T>
void solve_upwards(const Columns& columns, const T* factor, T* a, T* b) {
  for (int j = columns.n - 1; j >= 0; --j) {
    const T* const own = factor + columns.offset[j];
    const int below = columns.size[j];
    T first = a[j], second = b[j], odd_first = T(0), odd_second = T(0);
    int k = 1;
    for (; k + 2 <= below; k += 2) {
      const T left = own[k], right = own[k + 1];
      first = fnma(left, a[j + k], first);
      second = fnma(left, b[j + k], second);
      odd_first = fnma(right, a[j + k + 1], odd_first);
      odd_second = fnma(right, b[j + k + 1], odd_second);
    }
    if (k < below) {
      first = fnma(own[k], a[j + k], first);
      second = fnma(own[k], b[j + k], second);
    }
    a[j] = first + odd_first;
    b[j] = second + odd_second;
  }
}

/// b <- L^-1 b
template <class T>
void solve_downwards(const Columns& columns, const T* factor, T* b) {
  for (int j = 0; j < columns.n; ++j) {
    const T* own = factor + columns.offset[j];
    const T value = b[j];
    for (int k = 1, below = columns.size[j]; k < below; ++k) b[j + k] = fnma(own[k], value, b[j + k]);
  }
}

/// The same for two right-hand sides at once.
template <class T>
void solve_downwards(const Columns& columns, const T* factor, T* a, T* b) {
  for (int j = 0; j < columns.n; ++j) {
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
