// A step as a list of operations on numbered places, for kernels/listed.h to go through. SPDX-License-Identifier:
// Apache-2.0
//
// Written by generate/list.h; flat and constant, as the tables are.
#pragma once

#include <cstdint>

#include "plan/tables.h"
#include "trace/access.h"

namespace lockstep {

/// What an operation opcode with the numbers a, b and c. Masks are numbers of which only bits are looked at.
enum class Opcode : std::uint16_t {
  // of one number
  copy,
  negate,
  sqrt,
  invert,
  // of two
  add,
  subtract,
  multiply,
  divide,
  farther,
  less,
  beyond,
  either,
  both,  ///< beyond: b is beyond a
  // of three
  fma,
  fnma,
  fms,
  select,
  // of a constant a
  fill,
  add_constant,
  subtract_from_constant,
  multiply_constant,
  beyond_constant,
  fma_constant,
  fnma_constant,
  fill_rounding,
  sincos,  ///< of a, to `to` and c
  // what memory has to do with
  read,
  write,    ///< access a
  call,     ///< Call a on the tiles
  call_if,  ///< on those where mask `to` has lanes: accesses a to b written, Call d, accesses b to c read again
  end,      ///< of the list
};

constexpr bool is_arithmetic(Opcode opcode) { return opcode < Opcode::sincos; }
constexpr bool is_of_constant(Opcode opcode) { return opcode >= Opcode::fill && opcode <= Opcode::fnma_constant; }
/// How many numbers it takes, a constant among them.
constexpr int operands(Opcode opcode) {
  if (opcode <= Opcode::invert || opcode == Opcode::fill) return 1;
  if (opcode <= Opcode::both || (opcode >= Opcode::add_constant && opcode <= Opcode::beyond_constant)) return 2;
  return opcode <= Opcode::fnma_constant ? 3 : 0;
}
/// a and b are as good the other way round.
constexpr bool commutes(Opcode opcode) {
  return opcode == Opcode::add || opcode == Opcode::multiply || opcode == Opcode::fma || opcode == Opcode::fnma ||
         opcode == Opcode::fms;
}

/// Which of the numbers is the result of the operation before, that may have no slot.
enum class Last : std::uint16_t { none, a, b, c };

/// An operation with where its numbers come from, and whether its result goes to a slot.
struct Encoding {
  Opcode opcode = Opcode::end;
  Last last = Last::none;
  bool stored = false;

  constexpr int number() const { return (static_cast<int>(opcode) * 4 + static_cast<int>(last)) * 2 + stored; }
  static constexpr Encoding of(int number) {
    return {static_cast<Opcode>(number / 8), static_cast<Last>(number / 2 % 4), number % 2 > 0};
  }
};

/// Whether a list may have it.
constexpr bool can_be(Encoding encoding) {
  if (!is_arithmetic(encoding.opcode)) return encoding.last == Last::none && !encoding.stored;
  if (encoding.last == Last::a && is_of_constant(encoding.opcode)) return false;
  if (encoding.last == Last::b && commutes(encoding.opcode)) return false;
  return static_cast<int>(encoding.last) <= operands(encoding.opcode);
}

/// Two operations that are looked up as one (Proebsting 1995): how most sums of products begin and go on.
struct Superoperator {
  static constexpr int firsts = 6, seconds = 4, count = firsts * seconds;
  Encoding first, second;

  static constexpr Superoperator of(int index) {
    constexpr Encoding opens[firsts] = {{Opcode::multiply}, {Opcode::multiply_constant}, {Opcode::fma},
                                        {Opcode::fnma},     {Opcode::fma, Last::c},      {Opcode::fnma, Last::c}};
    constexpr Encoding goes_on[seconds] = {{Opcode::fma, Last::c, false},
                                           {Opcode::fma, Last::c, true},
                                           {Opcode::fnma, Last::c, false},
                                           {Opcode::fnma, Last::c, true}};
    return {opens[index / seconds], goes_on[index % seconds]};
  }
};

/// Numbers of forms; those of superoperators come behind them.
constexpr int single_encodings = Encoding{Opcode::end}.number() + 1,
              all_encodings = single_encodings + Superoperator::count;

/// Half as wide as numbers might be: lists are gone through all the time, and are to stay in the first cache.
struct Operation {
  /// The encoding's number, or that of a superoperator with the next one; slots; a is a constant's index where there is
  /// one.
  std::uint16_t encoding, to, a, b, c, d;
};

struct OperationList {
  static constexpr int tiles_at_once = 8;  ///< at the end of a batch 4, 2 or 1 do

  Span<Operation> constants_first;  ///< puts constants where no operation changes them; this and `step` have an end
  Span<Access> before;              ///< read before the first step of a call
  Span<Operation> step;
  Span<Access> after;  ///< written after the last one
  bool apart = false;  ///< tiles have numbers of their own in memory, for stages that are called
  Span<double> constants;
  Span<Access> accesses;
  int slots = 0;
  const OperationList* consistent =
      nullptr;  ///< the shorter step of tiles whose followers are all in place, if there is one
};

}  // namespace lockstep
