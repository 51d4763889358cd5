// The functions of this environment, and their values. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "kernels/tile/tile.h"
#include "simd/curves.h"

namespace lockstep::kernels {

/// The functions of the tables, the same in all lanes.
template <class T>
void uniform_functions(const Tables<ScalarOf<T>>& t, Tile<T>& x) {
  for (int i = 0; i < t.functions.number.count; ++i) x.functions.number[i] = T(t.functions.number[i]);
  for (int i = 0; i < t.functions.piece.count; ++i) x.functions.piece[i] = T(t.functions.piece[i]);
}

/// Those of this tile. The pieces of a table follow from its points (M136).
template <class T>
void own_functions(const Tables<ScalarOf<T>>& t, const StatePointers<ScalarOf<T>>& batch, Tile<T>& x) {
  const ScalarOf<T>* const own = batch.field(Parameter::function);
  for (int i = 0; i < t.functions.number.count; ++i) x.functions.number[i] = T::load(own + i * batch.stride);
  for (int i = 0; i < t.functions.places.count; ++i) {
    const FunctionPlace& f = t.functions.places[i];
    if (f.kind == FunctionKind::table)
      simd::spline_pieces(t.functions.constant.data + f.constant, f.count, x.functions.number + f.first,
                          x.functions.piece + f.piece);
  }
}

/// Function i at the position q of its leader.
template <class T>
LOCKSTEP_INLINE simd::Curve<T> curve_at(const Tables<ScalarOf<T>>& t, const Tile<T>& x, int i, T q) {
  const FunctionPlace& f = t.functions.places[i];
  const T* const own = x.functions.number + f.first;
  const ScalarOf<T>* const constant = t.functions.constant.data + f.constant;
  switch (f.kind) {
    case FunctionKind::polynomial: return simd::polynomial(own, f.count, q);
    case FunctionKind::table: return simd::spline(constant, x.functions.piece + f.piece, f.count, q);
    case FunctionKind::harmonic: break;
  }
  return simd::harmonic(own[0], own[1], own[2], T(*constant), q);
}

}  // namespace lockstep::kernels
