// What a unit impulse on each row does: (10), (15) and (19) of the note. SPDX-License-Identifier: Apache-2.0
//
// X = L^-T J^T and K = X^T D^-1 X = J A^-1 J^T, (M19). A row reaches only the joints
// of its own trees, so K is zero between rows whose paths meet in the fixed root alone, and not stored there.
#pragma once

#include "elimination.h"

namespace lockstep::kernels {

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

/// x <- L^-T x for a vector that is zero outside the row's support.
template <class T>
LOCKSTEP_INLINE void respond(const Rows<ScalarOf<T>>& rows, int row, const Columns& columns, const T* factored, T* x) {
  for (int s = rows.support_start[row + 1] - 1; s >= rows.support_start[row]; --s) {
    const SupportRange range = rows.support[s];
    x[range.index] = subtract_dot(factored + columns.offset[range.index] + 1, x + range.index + 1,
                                  range.end - range.index - 1, x[range.index]);
  }
}

/// X and D^-1 X of one row with these values of its terms.
template <class T>
LOCKSTEP_INLINE void row_response(const Tables<ScalarOf<T>>& t, const Tile<T>& x, const Rows<ScalarOf<T>>& rows, int row,
                                  const T* value, T* response, T* scaled) {
  for (int z = 0; z < t.solver.n; ++z) response[z] = scaled[z] = T(0);
  for (int k = rows.term_start[row]; k < rows.term_start[row + 1]; ++k) response[rows.term_index[k]] = value[k];
  respond(rows, row, t.solver, x.reduced, response);
  for (int i = rows.run_start[row]; i < rows.run_start[row + 1]; ++i)
    for (int z = rows.runs[i].first; z < rows.runs[i].last; ++z) scaled[z] = response[z] * x.inverse[z];
}

template <class T>
void responses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.rows;
  const int n = t.solver.n;
  for (int r = 0; r < rows.count; ++r)
    row_response(t, x, rows, r, x.row_value, x.response + r * n, x.scaled + r * n);
  if (rows.response_entries != rows.pairs.count)
    for (int e = 0; e < rows.response_entries; ++e) x.coupled[e] = T(0);
  for (int p = 0; p < rows.pairs.count; ++p) {
    const RowPair pair = rows.pairs[p];
    const T sum = supported_dot(rows, pair.other, x.response + pair.row * n, x.scaled + pair.other * n);
    x.coupled[pair.entry] = x.coupled[pair.mirror] = sum;
  }
}

/// r = J (M + armature)^-1 J^T, the inertia that (24) and (25) refer to, where A holds more than that.
template <class T>
void natural_responses(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  const Rows<ScalarOf<T>>& rows = t.natural;
  factor(t.matrix, x.natural_matrix, x.natural_inverse, T(0), x.scratch);
  for (int r = 0; r < rows.count; ++r) {
    for (int z = 0; z < t.velocities; ++z) x.natural_response[z] = T(0);
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      x.natural_response[rows.term_index[k]] = rows.coupling[r] < 0 ? T(1) : x.coefficient[rows.contribution[k].term];
    respond(rows, r, t.matrix, x.natural_matrix, x.natural_response);
    for (int z = 0; z < t.velocities; ++z) x.scratch[z] = x.natural_response[z] * x.natural_inverse[z];
    x.natural_compliance[r] = supported_dot(rows, r, x.natural_response, x.scratch);
  }
}

}  // namespace lockstep::kernels
