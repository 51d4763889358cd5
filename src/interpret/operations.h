// Operations of the interpreter: a step as a list of them, on numbered slots. SPDX-License-Identifier: Apache-2.0
//
// lower.h makes the list, run.h runs it. It is flat and constant, as the tables are.
#pragma once

#include <cstdint>

#include "plan/tables.h"
#include "trace/access.h"

namespace lockstep {

/// What an operation does with the numbers a, b and c. A mask is a number of which only the bits count.
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
  beyond,  ///< b is beyond a
  either,
  both,
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
  sincos,  ///< sine and cosine of a, to `to` and c
  // on the tiles in memory
  read,     ///< access a
  write,    ///< access a
  call,     ///< Call a on all tiles
  call_if,  ///< Call d on tiles whose mask `to` has lanes: writes accesses a to b before, reads accesses b to c after
  end,      ///< of the list
};

constexpr bool is_arithmetic(Opcode opcode) { return opcode < Opcode::sincos; }
constexpr bool is_of_constant(Opcode opcode) { return opcode >= Opcode::fill && opcode <= Opcode::fnma_constant; }
/// How many numbers it takes, its constant included.
constexpr int operands(Opcode opcode) {
  if (opcode <= Opcode::invert || opcode == Opcode::fill) return 1;
  if (opcode <= Opcode::both || (opcode >= Opcode::add_constant && opcode <= Opcode::beyond_constant)) return 2;
  return opcode <= Opcode::fnma_constant ? 3 : 0;
}
/// Whether a and b can be swapped.
constexpr bool commutes(Opcode opcode) {
  return opcode == Opcode::add || opcode == Opcode::multiply || opcode == Opcode::fma || opcode == Opcode::fnma ||
         opcode == Opcode::fms;
}

/// Which of the numbers is the result of the operation before. That may have no slot.
enum class Last : std::uint16_t { none, a, b, c };

/// An opcode, and how an operation with it gets its numbers and whether its result goes to a slot.
struct Encoding {
  Opcode opcode = Opcode::end;
  Last last = Last::none;
  bool stored = false;

  constexpr int number() const { return (static_cast<int>(opcode) * 4 + static_cast<int>(last)) * 2 + stored; }
  static constexpr Encoding of(int number) {
    return {static_cast<Opcode>(number / 8), static_cast<Last>(number / 2 % 4), number % 2 > 0};
  }
};

/// Whether an operation may have this encoding.
constexpr bool can_be(Encoding encoding) {
  if (!is_arithmetic(encoding.opcode)) return encoding.last == Last::none && !encoding.stored;
  if (encoding.last == Last::a && is_of_constant(encoding.opcode)) return false;
  if (encoding.last == Last::b && commutes(encoding.opcode)) return false;
  return static_cast<int>(encoding.last) <= operands(encoding.opcode);
}

/// Two operations that are dispatched as one (Proebsting 1995): most sums of products begin or go on with such a pair.
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

/// How many encodings there are. The superoperators come after the single ones.
constexpr int single_encodings = Encoding{Opcode::end}.number() + 1,
              all_encodings = single_encodings + Superoperator::count;

/// Sixteen bits for each number, so that the list stays in the first cache.
struct Operation {
  /// The number of the encoding, or of the superoperator of this operation and the next; then slots. If the operation
  /// has a constant, `a` is its index.
  std::uint16_t encoding, to, a, b, c, d;
};

struct OperationList {
  static constexpr int tiles_at_once = 8;  ///< at the end of a batch 4, 2 or 1

  Span<Operation> constants_first;  ///< fills slots with constants; ends with Opcode::end, like `step`
  Span<Access> before;              ///< what is read before the first step of a call
  Span<Operation> step;
  Span<Access> after;  ///< what is written after the last step of a call
  bool apart = false;  ///< each tile has its own arrays in memory, for stages that are called
  Span<double> constants;
  Span<Access> accesses;
  int slots = 0;
  const OperationList* consistent = nullptr;  ///< the shorter step of tiles whose followers are all consistent, or null
};

}  // namespace lockstep
