// Tile: the W environments that a kernel advances together, and its scratch memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bound_arrays.h"
#include "contact_arrays.h"
#include "coupling_arrays.h"
#include "diagnostic_arrays.h"
#include "dynamics_arrays.h"
#include "function_arrays.h"
#include "loop_arrays.h"
#include "record_arrays.h"
#include "routine_code.h"
#include "spatial_arrays.h"
#include "state_pointers.h"

namespace lockstep::kernels {

using simd::each_axis;

/// The largest finite number.
template <class S>
constexpr S largest_number = S(sizeof(S) == 4 ? 3.4028234e38 : 1.7976931348623157e308);

template <class T>
LOCKSTEP_INLINE T largest() {
  return T::by_precision(largest_number<float>, largest_number<double>);
}

/// Everything that one tile computes with: arrays of wide numbers in one block of scratch memory. An array that the
/// scene does not need has length 0.
template <class T>
struct Tile {
  State<T> state;  // where the step starts, or where the stage of an integrator is
  State<T> next;   // where the step ends, before check()
  T* half_turn;    // [4] by floating root: quaternion of half its turn over the step
  Stages<T> stages;
  Guard<T> guard;
  Bodies<T> bodies;
  ArticulatedBodies<T> articulated;
  Dynamics<T> dynamics;
  Couplings<T> couplings;
  FunctionArrays<T> functions;
  CouplingRows<T> rows;
  Undamped<T> undamped;
  BoundRows<T> bounds;
  ActiveSetSearch<T> search;
  HeldVelocities<T> held;
  RoundArrays<T> rounds;
  StageBounds<T> stage_bounds;
  MidpointArrays<T> midpoint;
  LimitedServos<T> servos;
  Contacts<T> contacts;
  LoopArrays<T> loops;
  SpatialArrays<T> spatial;
  SolveCounts<T> counts;
  Diagnostics<T> diagnostics;
  Records<T> records;
  Audit<T> audit;
  Routines routines;
  T unread_inputs;  // the largest of those that the routines' code leaves out, because it multiplies them by 0

  std::uint32_t step;         // steps that this call has taken
  typename T::Mask frozen;    // lanes that failed and take no more steps
  typename T::Mask singular;  // lanes whose matrix could not be factored
  typename T::Mask too_fast;  // lanes that move too fast for the step
  bool turned;                // some lane may have whole turns
  bool consistent;            // all placed followers of all lanes are consistent, and stay so (M76)
  bool corrects_positions;    // the position phase corrects the couplings' errors
  bool solves_twice;          // the velocity phase has a solution of its own
};

/// A parameter: one number for all environments, from the tables, or a row of a declared field.
template <class T>
struct Field {
  const ScalarOf<T>* table;
  const ScalarOf<T>* lanes;  // the declared field, null if there is none
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
