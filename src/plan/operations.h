// A step as a list of operations on numbered places, for kernels/listed.h to go through. SPDX-License-Identifier: Apache-2.0
//
// Written by generate/list.h; flat and constant, as the tables are.
#pragma once

#include <cstdint>

#include "tables.h"

namespace lockstep {

/// What an operation does with the numbers a, b and c. Masks are numbers of which only bits are looked at.
enum class Does : std::uint16_t {
  // of one number
  copy, negate, sqrt, invert,
  // of two
  add, subtract, multiply, divide, farther, less, beyond, either, both,  ///< beyond: b is beyond a
  // of three
  fma, fnma, fms, select,
  // of a constant a
  fill, add_constant, subtract_from_constant, multiply_constant, beyond_constant, fma_constant, fnma_constant,
  fill_rounding,
  sincos,  ///< of a, to `to` and c
  // what memory has to do with
  read, write,  ///< access a
  call,    ///< Call a on the tiles
  call_if, ///< on those where mask `to` has lanes: accesses a to b written, Call d, accesses b to c read again
  end,     ///< of the list
};

constexpr bool is_arithmetic(Does does) { return does < Does::sincos; }
constexpr bool is_of_constant(Does does) { return does >= Does::fill && does <= Does::fnma_constant; }
/// How many numbers it takes, a constant among them.
constexpr int operands(Does does) {
  if (does <= Does::invert || does == Does::fill) return 1;
  if (does <= Does::both || (does >= Does::add_constant && does <= Does::beyond_constant)) return 2;
  return does <= Does::fnma_constant ? 3 : 0;
}
/// a and b are as good the other way round.
constexpr bool commutes(Does does) {
  return does == Does::add || does == Does::multiply || does == Does::fma || does == Does::fnma || does == Does::fms;
}

/// Which of the numbers is the result of the operation before, that may have no slot.
enum class Last : std::uint16_t { none, a, b, c };

/// An operation with where its numbers come from, and whether its result goes to a slot.
struct Form {
  Does does = Does::end;
  Last last = Last::none;
  bool stored = false;

  constexpr int number() const { return (static_cast<int>(does) * 4 + static_cast<int>(last)) * 2 + stored; }
  static constexpr Form of(int number) {
    return {static_cast<Does>(number / 8), static_cast<Last>(number / 2 % 4), number % 2 > 0};
  }
};

/// Whether a list may have it.
constexpr bool can_be(Form form) {
  if (!is_arithmetic(form.does)) return form.last == Last::none && !form.stored;
  if (form.last == Last::a && is_of_constant(form.does)) return false;
  if (form.last == Last::b && commutes(form.does)) return false;
  return static_cast<int>(form.last) <= operands(form.does);
}

/// Two operations that are looked up as one (Proebsting 1995): how most sums of products begin and go on.
struct Superoperator {
  static constexpr int firsts = 6, seconds = 4, count = firsts * seconds;
  Form first, second;

  static constexpr Superoperator of(int index) {
    constexpr Form opens[firsts] = {{Does::multiply}, {Does::multiply_constant}, {Does::fma}, {Does::fnma},
                                    {Does::fma, Last::c}, {Does::fnma, Last::c}};
    constexpr Form goes_on[seconds] = {{Does::fma, Last::c, false}, {Does::fma, Last::c, true},
                                       {Does::fnma, Last::c, false}, {Does::fnma, Last::c, true}};
    return {opens[index / seconds], goes_on[index % seconds]};
  }
};

/// Numbers of forms; those of superoperators come behind them.
constexpr int single_forms = Form{Does::end}.number() + 1, all_forms = single_forms + Superoperator::count;

/// Stages that look at what is in the lanes before they know what to do: they are called, as the tables' kernels call them.
enum class Call : int { none, compete, coupling_impulses, diagnose, hold };

/// Half as wide as numbers might be: lists are gone through all the time, and are to stay in the first cache.
struct Operation {
  /// The form's number, or that of a superoperator with the next one; slots; a is a constant's index where there is one.
  std::uint16_t form, to, a, b, c, d;
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

  Span<Operation> constants_first;  ///< puts constants where no operation changes them; this and `step` have an end
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
