// Tile: the W environments that a kernel advances together, and its scratch memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bound_arrays.h"
#include "coupling_arrays.h"
#include "diagnostic_arrays.h"
#include "dynamics_arrays.h"
#include "state_pointers.h"

namespace lockstep::kernels {

using simd::each_axis;

/// The largest finite number.
template <class S>
constexpr S largest_number = S(sizeof(S) == 4 ? 3.4028234e38 : 1.7976931348623157e308);

/// Everything that one tile computes with, as arrays of wide numbers in one block of scratch memory.
/// An array that the scene has no use for has length 0.
template <class T>
struct Tile {
  State<T> state;  // where the step starts; within an integrator with several stages, the stage's
  State<T> next;   // where it ends, before that is checked
  T* half_turn;    // [4] quaternion of half the root's turn over the step
  Stages<T> stages;
  Bodies<T> bodies;
  ArticulatedBodies<T> articulated;
  Dynamics<T> dynamics;
  Couplings<T> couplings;
  CouplingRows<T> rows;
  Undamped<T> undamped;
  BoundRows<T> bounds;
  ActiveSetSearch<T> search;
  LimitedServos<T> servos;
  Diagnostics<T> diagnostics;

  typename T::Mask frozen;
  typename T::Mask singular;
  bool consistent;          // all followers of all lanes satisfy their couplings to the last bit, and stay so (M76)
  bool corrects_positions;  // solutions of the position phase correct the couplings' errors
  bool solves_twice;        // and the velocity phase has a solution of its own
};

/// A number that is the table's for all environments, or a row of a declared field.
template <class T>
struct Field {
  const ScalarOf<T>* table;
  const ScalarOf<T>* lanes;  // null: the table's
  std::ptrdiff_t stride;
  LOCKSTEP_INLINE T at(int table_index, int row) const {
    return lanes ? T::load(lanes + row * stride) : T(table[table_index]);
  }
};

template <class T>
LOCKSTEP_INLINE Field<T> field(const StatePointers<ScalarOf<T>>& batch, Parameter parameter, const ScalarOf<T>* table) {
  return {table, batch.field(parameter), batch.stride};
}

}  // namespace lockstep::kernels
