// Registers for the values of a listing: instructions. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "machine.h"
#include "operations.h"

namespace lockstep::jit {

struct Instruction {
  enum Kind : std::uint8_t {
    load,     ///< `at` to `to`
    store,    ///< a to `at`
    move,     ///< a to `to`
    compute,  ///< `op`, of a, b and c; with `in_memory` the last of the first two stands at `at`
    fused,    ///< `op` is a multiply-add: `to` is overwritten, in the form `number`: 132, 213 or 231
    ternary,  ///< any function of the bits of `to`, a and b: `number` is its table
    begin_part,
    end_part,
    begin_loop,    ///< `number` times
    begin_unless,  ///< if a lane of a is true, on behind its end
    begin_scope,   ///< if no lane of a is true, on behind its end; turns are counted down from `number` at `at`
    end_loop,
    end_scope,  ///< back to its begin if a lane of a is true and turns are left; without a, on
    if_any,     ///< if a lane of a is true: cold part `number`
    call,       ///< the stage `number`
    resume,     ///< of cold part `number`: back behind its if_any
    run,        ///< subroutine `number`
  };
  Kind kind = compute;
  Op op = Op::copy;
  std::int8_t to = -1, a = -1, b = -1, c = -1;
  bool in_memory = false;  ///< the last of the operands stands in memory, at `at`
  int number = 0;
  Memory at = {};
  Value value = -1;  ///< that it computes or reads
};

struct Allocated {
  std::vector<Instruction> instructions;
  std::vector<std::vector<Instruction>> cold;         ///< rare parts, by number: they stand behind the others
  std::vector<std::vector<Instruction>> subroutines;  ///< and these behind them
  int slots = 0;                                      ///< of a tile
  int first_handed = 0;                               ///< the slot from which on numbers are handed to subroutines
  int spills = 0, reloads = 0, parts = 1;
};

/// Two passes over the list: the uses of each value, then the registers. A register is taken from the value that is
/// needed last, where a value that must be stored first counts half its distance (Belady 1966 with write-back). Inputs
/// and constants are never stored, but read again.
Allocated allocate(const Listing& listing, const Machine& machine);

}  // namespace lockstep::jit
