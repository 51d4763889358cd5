// A step as a list of operations on numbered places, for kernels/listed.h to go through. SPDX-License-Identifier: Apache-2.0
//
// Written by generate/list.h; flat and constant, as the tables are.
#pragma once

#include <cstdint>

#include "tables.h"

namespace lockstep {

/// What an operation does with the numbers a, b and c. Masks are numbers of which only bits are looked at.
enum class Does : std::uint16_t {
  copy, negate, add, subtract, multiply, divide, fma, fnma, fms, sqrt, farther, less, beyond,  ///< beyond: b is beyond a
  either, both, invert, select,
  // where a is a constant
  add_constant, subtract_from_constant, multiply_constant, fma_constant, fnma_constant, beyond_constant,
  fill,    ///< with a constant
  fill_rounding,
  sincos,  ///< of a, to `to` and c
  // what memory has to do with
  read, write,  ///< access a
  call,    ///< Call a on the tiles
  call_if, ///< on those where mask `to` has lanes: accesses a to b written, Call d, accesses b to c read again
};

/// Which of the numbers is the result of the operation before, that may have no slot.
enum class Last : std::uint16_t { none, a, b, c };

constexpr int form_of(Does does, Last last) { return 4 * static_cast<int>(does) + static_cast<int>(last); }

/// Stages that look at what is in the lanes before they know what to do: they are called, as the tables' kernels call them.
enum class Call : int { none, compete, coupling_impulses, diagnose, hold };

/// Half as wide as numbers might be: lists are gone through all the time, and are to stay in the first cache.
struct Operation {
  static constexpr std::uint16_t nowhere = 0xffff;
  std::uint16_t form, to, a, b, c, d;  ///< slots, `to` is nowhere where none is wanted; a is a constant's index where there is one
};

/// Where a number stands that is read or written.
struct Access {
  /// From 0 on the tile's arrays, in the order of kernels::arrays(); from first_row on rows of the batch.
  enum : int { frozen = -1, singular = -2, failed = -3, suspect = -4, nowhere = -5,
               first_row = 1000, position_target = first_row, velocity_target, effort, field };
  int slot, array, number;
};

struct OperationList {
  static constexpr int tiles_at_once = 8;  ///< at the end of a batch 4, 2 or 1 do

  Span<Operation> constants_first;  ///< puts constants where no operation changes them
  Span<Access> before;    ///< read before the first step of a call
  Span<Operation> step;
  Span<Access> after;     ///< written after the last one
  bool apart = false;     ///< tiles have numbers of their own in memory, for stages that are called
  Span<double> constants;
  Span<Access> accesses;
  int slots = 0;
  const OperationList* in_place = nullptr;  ///< the shorter step of tiles whose followers are all in place, if there is one
};

}  // namespace lockstep
