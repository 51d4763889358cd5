// One projected Gauss-Seidel sweep over the rows, on impulses. SPDX-License-Identifier: Apache-2.0
//
// (16) and (18) of the note, with a memory of the impulse (M30). With it a soft row is the spring (21) however often it
// is visited; (M31) is what happens without it. Sweeps change J v through K and never walk the tree. They store
// residuals instead of speeds (M34), so a visit waits for little of the one before.
#pragma once

#include "row_terms.h"

namespace lockstep::kernels {

/// Calls act(first, last) for runs of rows that row r moves.
template <class S, class Act>
LOCKSTEP_INLINE void each_neighbours(const Rows<S>& rows, int r, Act&& act) {
  if (rows.dense) return act(0, rows.count);
  for (int n = rows.neighbour_start[r]; n < rows.neighbour_start[r + 1]; ++n)
    act(rows.neighbours[n].first, rows.neighbours[n].last);
}

/// 1 / (r + cfm), and K as visits use it: what a visit subtracts from other residuals for each unit of its own.
template <class T>
LOCKSTEP_INLINE void prepare_visits(const Rows<ScalarOf<T>>& rows, Tile<T>& x) {
  for (int r = 0; r < rows.count; ++r) {
    T* const k_row = x.rows.delassus + r * rows.count;
    const T inverse = x.rows.inverse[r] = T(1) / (k_row[r] + x.rows.cfm[r]);
    each_neighbours(rows, r, [&](int first, int last) LOCKSTEP_INLINED {
      for (int i = first; i < last; ++i) k_row[i] *= inverse;
    });
  }
}

/// The residual of a row that has no impulse yet.
template <class T>
LOCKSTEP_INLINE void begin_row(const Tile<T>& x, int r) {
  x.rows.impulse[r] = T(0);
  x.rows.residual[r] = x.rows.speed[r] + x.rows.bias[r];
}

/// Gives the row another bias.
template <class T>
LOCKSTEP_INLINE void change_bias(const Tile<T>& x, int r, T bias) {
  x.rows.residual[r] += bias - x.rows.bias[r];
  x.rows.bias[r] = bias;
}

/// J v, from the residual.
template <class T>
LOCKSTEP_INLINE T speed_of(const Tile<T>& x, int r) {
  return fnma(x.rows.cfm[r], x.rows.impulse[r], x.rows.residual[r] - x.rows.bias[r]);
}

/// One visit (M34). Returns the change of the row's impulse.
template <class T>
LOCKSTEP_INLINE T visit(const Rows<ScalarOf<T>>& rows, int r, Tile<T>& x) {
  T* const residual = x.rows.residual;
  const T own = residual[r], change = -(own * x.rows.inverse[r]);
  x.rows.impulse[r] += change;
  const T* const k_row = x.rows.delassus + r * rows.count;
  each_neighbours(rows, r, [&](int first, int last) LOCKSTEP_INLINED {
    for (int i = first; i < last; ++i) residual[i] = fnma(k_row[i], own, residual[i]);
  });
  residual[r] = T(0);  // with the part of cfm too
  return change;
}

/// Calls `turn` so many times. Each turn leaves numbers to the next in the arrays `handed`, which are as long as there
/// are rows. A traced loop has to know them (trace/called_stages.h).
template <class T, int N, class Turn>
LOCKSTEP_INLINE void repeat(int times, const Tile<T>&, T* const (&)[N], int, Turn&& turn) {
  for (int i = 0; i < times; ++i) turn();
}

template <class T>
LOCKSTEP_INLINE void sweep(const Rows<ScalarOf<T>>& rows, Tile<T>& x) {
  for (int r = 0; r < rows.count; ++r) visit(rows, r, x);
}

template <class T>
LOCKSTEP_INLINE void sweeps(const Rows<ScalarOf<T>>& rows, int times, Tile<T>& x) {
  T* const handed[] = {x.rows.residual, x.rows.impulse};
  repeat(times, x, handed, rows.count, [&] { sweep(rows, x); });
}

}  // namespace lockstep::kernels
