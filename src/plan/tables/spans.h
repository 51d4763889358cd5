// Lists, and the structure of sparse matrices. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// Stands for infinity in tables: any step size or gear ratio can scale it in single precision.
constexpr double unlimited = 1e25;

/// A smaller compliance counts as 0.
constexpr double smallest_compliance = 1e-30;

/// gamma of (M69): the share of a step that an implicit stage covers.
constexpr double alexander_gamma = 0.43586652150845899942;

template <class E>
struct Span {
  const E* data = nullptr;
  int count = 0;
  inline __attribute__((always_inline)) const E& operator[](int i) const { return data[i]; }
};

/// Structure of a sparse symmetric matrix H = L^T D L. Column j holds the rows j to j + size[j] - 1, contiguous from
/// offset[j]: its elimination tree is numbered depth first, so subtrees are ranges. The mass matrix has this structure
/// without fill-in (Featherstone 2008, section 6.5).
struct Columns {
  int n = 0;
  int entries = 0;
  Span<int> parent;     ///< -1 for a root of the tree
  Span<int> size;       ///< of the subtree, including its root
  Span<int> offset;     ///< of column j's diagonal
  Span<int> row_start;  ///< n + 1
  Span<int> row;        ///< entries of row i in the columns of its ancestors, the nearest first
};

}  // namespace lockstep
