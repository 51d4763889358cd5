// A step as operations on numbered values: what the registers are given to. SPDX-License-Identifier: Apache-2.0
//
// Each operation is one instruction or two. A mask is a value of which only the bits count: all ones in the lanes where
// it is true.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "trace/access.h"

namespace lockstep::jit {

using Value = int;

enum class Op : std::uint8_t {
  // of one value
  copy,
  sqrt,
  shift_left,   ///< by `number` bits, of integers
  spread_sign,  ///< the top bit in all bits
  // of two
  add,
  subtract,
  multiply,
  divide,
  less,
  greater,  ///< of integers
  larger,   ///< of integers
  both,
  either,
  differ,  ///< bits that differ
  // of three
  fma,      ///< a b + c
  fms,      ///< a b - c
  fnma,     ///< c - a b
  select,   ///< a ? b : c
  differ3,  ///< a ^ b ^ c
  // on memory
  store,    ///< a to `at`
  assign,   ///< a to the variable `to` of a loop
  call,     ///< Listing::calls[number]
  call_if,  ///< the same where a lane of a is true
  run,      ///< Listing::runs[number]
  // of loops and scopes, which nest
  begin_loop,    ///< to be repeated `number` times
  begin_unless,  ///< to be left out if a lane of a is true
  begin_scope,   ///< to be left out if no lane of a is true, and repeated `number` times at most
  end_loop,
  end_scope,  ///< to be repeated while a lane of a is true; without a, to be left
  // behind the step itself
  begin_subroutine,  ///< `number`
  end_subroutine,
};
constexpr bool begins(Op op) { return op >= Op::begin_loop && op <= Op::begin_scope; }
constexpr bool ends(Op op) { return op == Op::end_loop || op == Op::end_scope; }

constexpr int operands(Op op) {
  if (op <= Op::spread_sign || op == Op::store || op == Op::assign || op == Op::call_if || op == Op::begin_scope ||
      op == Op::begin_unless || op == Op::end_scope)
    return 1;
  if (op <= Op::differ) return 2;
  return op <= Op::differ3 ? 3 : 0;
}
constexpr bool has_result(Op op) { return op <= Op::differ3; }
/// Whether a and b can be swapped.
constexpr bool commutes(Op op) { return op == Op::add || op == Op::multiply || (op >= Op::larger && op <= Op::fnma); }

/// A number in memory: an offset in bytes from a base.
struct Memory {
  enum Base : std::uint8_t { none, block, slots, tile, constants, handed };
  Base base = none;
  int offset = 0;
  friend bool operator==(const Memory&, const Memory&) = default;
};

struct Operation {
  Op op = Op::copy;
  Value to = -1;
  std::array<Value, 3> from{-1, -1, -1};
  int number = 0;  ///< bits of a shift, index of a call, times of a loop or scope
  Memory at = {};  ///< of a store
  int time = 0;    ///< of an operation on memory: how many have changed it before
};

/// A call of a stage in the library, which works on the tile in memory.
struct StageCall {
  struct Write {
    Memory at;
    Value value;
  };
  /// A number that the stage may change.
  struct Variable {
    Memory at;
    Value before, after;
  };
  Call stage = Call::none;
  std::vector<Write> writes;
  std::vector<Variable> variables;
};

/// A run of a subroutine, which works on numbers that are handed to it in slots.
struct SubroutineRun {
  int subroutine = 0;
  bool calls = false;  ///< it calls stages
  std::vector<Memory> changes;
  std::vector<Value> results;
};

/// A step as a list of operations, and behind them those of its subroutines.
struct Listing {
  std::vector<Operation> operations;
  std::vector<StageCall> calls;
  std::vector<SubroutineRun> runs;
  std::vector<Memory> home;  ///< by value: where inputs and constants can be read at any time; else Memory::none
  std::vector<char> fixed;   ///< by value: called stages do not change its home
  std::vector<int> born;     ///< by value: the time of the memory that its home has it from
  std::vector<std::uint64_t> constants;  ///< bits, by index
  std::vector<Access> rows;              ///< of the batch, by slot from 1 on
  int handed = 0;                        ///< numbers that are handed to subroutines and back
  std::vector<std::string> names;        ///< by value: what the graph calls it, for people
};

}  // namespace lockstep::jit
