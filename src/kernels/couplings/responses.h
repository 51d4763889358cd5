// What a unit impulse on each row does: (10), (15) and (19) of the note. SPDX-License-Identifier: Apache-2.0
//
// X = L^-T J^T and K = X^T D^-1 X = J A^-1 J^T, (M19). An impulse on a row moves only the joints of its own trees. So K
// is zero, and not stored, between rows of different trees, and between rows whose paths meet only in a bolted root.
#pragma once

#include "elimination.h"
#include "kernels/dynamics/articulated.h"

namespace lockstep::kernels {

/// A count that is known at compile time.
template <int N>
struct Count {
  static constexpr int value = N;
};

/// a . b over the velocities that the row moves.
template <class T>
LOCKSTEP_INLINE T supported_dot(const Rows<ScalarOf<T>>& rows, int row, const T* a, const T* b) {
  T sum = T(0);
  for (int i = rows.run_start[row]; i < rows.run_start[row + 1]; ++i) {
    const SupportRun run = rows.runs[i];
    sum = subtract_dot(a + run.first, b + run.first, run.last - run.first, sum);
  }
  return -sum;
}

/// x <- L^-T x for N vectors that are `stride` numbers apart, and zero outside the support.
template <int N, class T>
LOCKSTEP_INLINE void respond(const SupportRange* first, const SupportRange* last, const Columns& columns,
                             const T* factored, T* x, int stride) {
  while (last != first) {
    const SupportRange range = *--last;
    const T* const column = factored + columns.offset[range.index];
    T* const own = x + range.index;
    const int count = range.end - range.index;
    if constexpr (N == 1) {
      own[0] = subtract_dot(column + 1, own + 1, count - 1, own[0]);
    } else {
      T sum[N];
      for (int n = 0; n < N; ++n) sum[n] = own[n * stride];
      for (int k = 1; k < count; ++k)
        for (int n = 0; n < N; ++n) sum[n] = fnma(column[k], own[n * stride + k], sum[n]);
      for (int n = 0; n < N; ++n) own[n * stride] = sum[n];
    }
  }
}

/// Calls act(Count) for the group's number of rows.
template <class Act>
LOCKSTEP_INLINE void with_count(const RowGroup& group, Act&& act) {
  static_assert(RowGroup::most == 8);
  switch (group.count) {
    case 1: return act(Count<1>{});
    case 2: return act(Count<2>{});
    case 3: return act(Count<3>{});
    case 4: return act(Count<4>{});
    case 5: return act(Count<5>{});
    case 6: return act(Count<6>{});
    case 7: return act(Count<7>{});
    default: return act(Count<8>{});
  }
}

/// J^T of one row, from the values of its terms.
template <class T>
LOCKSTEP_INLINE void place_terms(const Rows<ScalarOf<T>>& rows, int row, int n, const T* value, T* response) {
  for (int z = 0; z < n; ++z) response[z] = T(0);
  for (int k = rows.term_start[row]; k < rows.term_start[row + 1]; ++k) response[rows.term_index[k]] = value[k];
}

/// D^-1 X of one row.
template <class T>
LOCKSTEP_INLINE void scale_response(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const T* response, T* scaled) {
  for (int z = 0; z < t.solver.n; ++z) scaled[z] = response[z] * x.dynamics.inverse[z];
}

/// K of a block, whose rows are given as D^-1 X, one after the other.
template <int M, int N, class T>
LOCKSTEP_INLINE void fill_block(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const RowBlock& block,
                                const T* scaled) {
  const int n = t.solver.n;
  const T* const other = x.rows.response + block.column * n;
  T sum[M][N];
  for (int i = 0; i < M; ++i)
    for (int k = 0; k < N; ++k) sum[i][k] = T(0);
  for (int r = block.run_first; r < block.run_last; ++r)
    for (int z = t.rows.block_runs[r].first, last = t.rows.block_runs[r].last; z < last; ++z)
      for (int k = 0; k < N; ++k)
        for (int i = 0; i < M; ++i) sum[i][k] = fma(scaled[i * n + z], other[k * n + z], sum[i][k]);
  for (int i = 0; i < M; ++i)
    for (int k = 0; k < N; ++k)
      if (block.entry[i][k] >= 0) x.rows.delassus[block.entry[i][k]] = x.rows.delassus[block.mirror[i][k]] = sum[i][k];
}

/// Calls act(Count, Count) for the block's numbers of rows and columns.
template <class Act>
LOCKSTEP_INLINE void with_counts(const RowBlock& block, Act&& act) {
  static_assert(RowBlock::most_rows == 2 && RowBlock::most_columns == 4);
  const auto with_columns = [&](auto rows) LOCKSTEP_INLINED {
    switch (block.columns) {
      case 1: return act(rows, Count<1>{});
      case 2: return act(rows, Count<2>{});
      case 3: return act(rows, Count<3>{});
      default: return act(rows, Count<4>{});
    }
  };
  block.rows == 1 ? with_columns(Count<1>{}) : with_columns(Count<2>{});
}

template <class T>
void responses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int n = t.solver.n;
  const SupportRange* const support = rows.group_support.data;
  for (int r = 0; r < rows.count; ++r) place_terms(rows, r, n, x.rows.value, x.rows.response + r * n);
  if (t.articulated.used()) solve_inwards(t, x, t.articulated.rows, x.rows.response, n);
  for (int g = 0; g < rows.groups.count; ++g) {
    const RowGroup& group = rows.groups[g];
    if (group.articulated) continue;
    with_count(group, [&](auto count) LOCKSTEP_INLINED {
      respond<count.value>(support + group.support_first, support + group.support_last, t.solver, x.dynamics.reduced,
                           x.rows.response + group.first * n, n);
    });
  }
  if (!rows.dense)
    for (int e = 0; e < rows.response_entries; ++e) x.rows.delassus[e] = T(0);
  for (int b = 0; b < rows.blocks.count; ++b) {
    const RowBlock& block = rows.blocks[b];
    if (b == 0 || rows.blocks[b - 1].row != block.row)
      for (int i = 0; i < block.rows; ++i)
        scale_response(t, x, x.rows.response + (block.row + i) * n, x.dynamics.scratch + i * n);
    with_counts(
        block, [&](auto m, auto k) LOCKSTEP_INLINED { fill_block<m.value, k.value>(t, x, block, x.dynamics.scratch); });
  }
}

/// r = J (M + armature)^-1 J^T, to which (24) and (25) of the note refer, where A has more than that.
template <class T>
void undamped_responses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.undamped;
  for (int r = 0; r < t.undamped_velocities.count; ++r)
    factor(t.matrix, t.undamped_velocities[r], x.undamped.matrix, x.undamped.inverse, T(0));
  for (int r = 0; r < rows.count; ++r) {
    for (int z = 0; z < t.velocities; ++z) x.undamped.response[z] = T(0);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      x.undamped.response[rows.term_index[k]] =
          rows.coupling[r] < 0 ? T(1) : x.couplings.coefficient[rows.contribution[k].term];
    const SupportRange* const support = rows.support.data;
    respond<1>(support + rows.support_start[r], support + rows.support_start[r + 1], t.matrix, x.undamped.matrix,
               x.undamped.response, 0);
    for (int z = 0; z < t.velocities; ++z) x.dynamics.scratch[z] = x.undamped.response[z] * x.undamped.inverse[z];
    x.undamped.compliance[r] = supported_dot(rows, r, x.undamped.response, x.dynamics.scratch);
  }
}

}  // namespace lockstep::kernels
