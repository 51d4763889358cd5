// Where values stand while a listing becomes instructions: registers, slots, and the homes of inputs and constants.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "allocate.h"
#include "uses.h"

namespace lockstep::jit {

/// Moves values between registers and memory, and emits the instructions for it. A value whose last use has been taken
/// stands nowhere.
class Places {
 public:
  Places(const Listing& listing, const Machine& machine, Uses& uses, Allocated& out);

  void emit(const Instruction& instruction) { code_->push_back(instruction); }
  Instruction& last() { return code_->back(); }

  // Registers.

  /// -1 if it is in none.
  int register_of(Value v) const { return register_[v]; }
  /// -1 if it holds none.
  Value held_by(int r) const { return holds_[r]; }
  int registers() const { return static_cast<int>(holds_.size()); }
  void give(int r, Value v) { register_[v] = r, holds_[r] = v; }
  /// The register keeps its bits, and holds no value.
  void release(int r);
  /// A pinned register keeps its value until unpin().
  void pin(int r) { pinned_[r] = true; }
  void unpin() { pinned_.assign(pinned_.size(), false); }
  /// The value's register, which is pinned; loads it if it is in none.
  int load(Value v);
  /// A register that holds nothing, or -1 if all are pinned.
  int free_register_or_none();
  int free_register();
  /// The value goes to memory if it is still needed.
  void push_out(int r);
  void push_all_out();
  /// The register of a pinned value that is still needed, to be overwritten.
  int overwritten(Value v);
  void copy(Value to, Value from);
  /// `to` stands where `from` has stood.
  void rename(Value from, Value to);
  /// This operation, whose instructions have been emitted, has used the value.
  void used(Value v);

  // Memory.

  bool in_memory(Value v) const { return slot_[v] >= 0 || has_home(v); }
  bool has_home(Value v) const { return home_[v].base != Memory::none; }
  bool has_slot(Value v) const { return slot_[v] >= 0; }
  Memory place(Value v) const { return slot_[v] >= 0 ? slot(v) : home_[v]; }
  Memory slot(Value v) const { return numbered(first_slot() + slot_[v]); }
  /// Where a rare part saves register r.
  Memory cold_slot(int r) const { return numbered(first_cold_slot() + r); }
  /// A slot that holds no value.
  int take_slot();
  Memory slot_number(int slot) const { return numbered(first_slot() + slot); }
  void free_slot(int slot) { free_slots_.push_back(slot); }
  int first_handed() const { return 1 + rows_; }
  int slots() const { return first_slot() + slots_; }

  /// Memory at `at` is about to change, and to hold `written`. Other values that still have it as home leave it; those
  /// that are read at a later time do not count.
  void leave(const Memory& at, Value written, int time);
  /// A stage may change any memory but that of fixed homes and of what is handed to subroutines.
  void leave_all(int time);
  /// A scope that may not run changes what is handed to subroutines.
  void leave_handed(int time);
  /// A subroutine begins: it has slots of its own, and finds nothing in registers.
  void begin_subroutine(std::vector<Instruction>& code);

 private:
  int first_cold_slot() const { return first_handed() + handed_; }
  int first_slot() const { return first_cold_slot() + registers(); }
  Memory numbered(int number) const { return {Memory::slots, number * register_bytes_}; }
  void store_to_slot(Value v);
  void leave_home(Value v);

  const Listing& listing_;
  Uses& uses_;
  Allocated& out_;
  std::vector<Instruction>* code_;  // that is being written
  std::vector<Memory> home_;        // by value
  std::map<std::pair<int, int>, std::vector<Value>> at_home_;
  std::vector<int> register_, slot_;  // by value
  std::vector<Value> holds_;          // by register
  std::vector<char> pinned_;          // by register
  std::vector<int> free_slots_;
  int slots_ = 0, rows_, handed_, register_bytes_;
};

}  // namespace lockstep::jit
