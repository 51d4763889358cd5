// One projected Gauss-Seidel sweep over the rows, on impulses. SPDX-License-Identifier: Apache-2.0
//
// (16) and (18) of the note with the memory that makes a soft row the spring (21) however often it is visited:
// (M30), and (M31) for what becomes of it without. Working on J v through K, no sweep walks the tree; what is
// kept is not the speed but what the row lacks (M34), so that a visit waits for little of the visit before.
#pragma once

#include "row_terms.h"

namespace lockstep::kernels {

/// Runs of rows that row r moves: act(first, last).
template <class S, class Act>
LOCKSTEP_INLINE void each_neighbours(const Rows<S>& rows, int r, Act&& act) {
  if (rows.dense) return act(0, rows.count);
  for (int n = rows.neighbour_start[r]; n < rows.neighbour_start[r + 1]; ++n)
    act(rows.neighbours[n].first, rows.neighbours[n].last);
}

/// 1 / (r + cfm), and K as visits want it: what other rows lack for each that the visited one does.
template <class T>
LOCKSTEP_INLINE void prepare_visits(const Rows<ScalarOf<T>>& rows, Tile<T>& x) {
  for (int r = 0; r < rows.count; ++r) {
    T* const coupled = x.rows.delassus + r * rows.count;
    const T inverse = x.rows.inverse[r] = T(1) / (coupled[r] + x.rows.cfm[r]);
    each_neighbours(rows, r, [&](int first, int last) LOCKSTEP_INLINED {
      for (int i = first; i < last; ++i) coupled[i] *= inverse;
    });
  }
}

/// What the row lacks before it has an impulse.
template <class T>
LOCKSTEP_INLINE void begin_row(const Tile<T>& x, int r) {
  x.rows.impulse[r] = T(0);
  x.rows.residual[r] = x.rows.speed[r] + x.rows.bias[r];
}

/// The same row with another bias.
template <class T>
LOCKSTEP_INLINE void change_bias(const Tile<T>& x, int r, T bias) {
  x.rows.residual[r] += bias - x.rows.bias[r];
  x.rows.bias[r] = bias;
}

/// J v, from what the row lacks.
template <class T>
LOCKSTEP_INLINE T speed_of(const Tile<T>& x, int r) {
  return fnma(x.rows.cfm[r], x.rows.impulse[r], x.rows.residual[r] - x.rows.bias[r]);
}

/// One visit (M34); returns the change of the row's impulse.
template <class T>
LOCKSTEP_INLINE T visit(const Rows<ScalarOf<T>>& rows, int r, Tile<T>& x) {
  T* const residual = x.rows.residual;
  const T lacking = residual[r], change = -(lacking * x.rows.inverse[r]);
  x.rows.impulse[r] += change;
  const T* const coupled = x.rows.delassus + r * rows.count;
  each_neighbours(rows, r, [&](int first, int last) LOCKSTEP_INLINED {
    for (int i = first; i < last; ++i) residual[i] = fnma(coupled[i], lacking, residual[i]);
  });
  residual[r] = T(0);  // cfm takes the rest
  return change;
}

/// Opcode `turn` so many times. What one turn hands to the next stands in the arrays `handed`, each as long as there
/// are rows: whoever writes the loop down as code (generate/) must know.
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
