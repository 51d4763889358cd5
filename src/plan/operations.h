// A step as a list of operations on numbered places, for kernels/listed.h to go through. SPDX-License-Identifier: Apache-2.0
//
// Written by generate/list.h; flat and constant, as the tables are.
#pragma once

#include "tables.h"

namespace lockstep {

/// What the operations of a run do with the numbers in slots a to e. Masks are numbers of which only bits are looked at.
enum class Does : int {
  copy, negate, add, subtract, multiply, divide, fma, fnma, fms, sqrt, farther, less, beyond,  ///< beyond: b is beyond a
  either, both, invert, select,
  // two at a time: the second one's sum and what the first makes of c, d and e
  fma_multiply, fnma_multiply, fms_multiply, fma_fma, fma_fnma, fnma_fma, fnma_fnma,
  sincos,  ///< of a, to `to` and c
  // where a is a constant
  add_constant, subtract_from_constant, multiply_constant, fma_constant, fnma_constant, beyond_constant,
  fill,    ///< with a constant
  fill_rounding,
  // what memory has to do with
  read, write,  ///< access a
  call,    ///< a Call on the tiles
  call_if, ///< on those where mask a has lanes: accesses b to c written, Call d, accesses c to `to` read again
};

/// Stages that look at what is in the lanes before they know what to do: they are called, as the tables' kernels call them.
enum class Call : int { none, compete, coupling_impulses, diagnose, hold };

struct Operation {
  int to, a, b, c, d, e;  ///< slots; a is a constant's index where there is one; a Call in `to`
};

/// Where a number stands that is read or written.
struct Access {
  /// From 0 on the tile's arrays, in the order of kernels::arrays(); from first_row on rows of the batch.
  enum : int { frozen = -1, singular = -2, failed = -3, suspect = -4, nowhere = -5,
               first_row = 1000, position_target = first_row, velocity_target, effort, field };
  int slot, array, number;
};

/// What does the same, one at least.
struct Run {
  Does does;
  const Operation *first, *last;
};

struct OperationList {
  Span<Run> constants_first;  ///< puts constants where no operation changes them
  Span<Access> before;        ///< read before the first step of a call
  Span<Run> runs;             ///< a step
  Span<Access> after;         ///< written after the last one
  bool apart = false;         ///< tiles have numbers of their own in memory, for stages that are called
  Span<double> constants;
  Span<Access> accesses;
  int slots = 0;
  const OperationList* in_place = nullptr;  ///< the shorter step of tiles whose followers are all in place, if there is one
};

}  // namespace lockstep
