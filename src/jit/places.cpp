// SPDX-License-Identifier: Apache-2.0
#include "places.h"

#include <stdexcept>

namespace lockstep::jit {
namespace {

constexpr double store_first = 0.5;  // weight of the distance of a value that must be stored

}  // namespace

Places::Places(const Listing& listing, const Machine& machine, Uses& uses, Allocated& out)
    : listing_(listing),
      uses_(uses),
      out_(out),
      code_(&out.instructions),
      home_(listing.home),
      register_(home_.size(), -1),
      slot_(home_.size(), -1),
      holds_(static_cast<std::size_t>(machine.registers), -1),
      pinned_(holds_.size(), false),
      rows_(static_cast<int>(listing.rows.size())),
      handed_(listing.handed),
      register_bytes_(machine.register_bytes) {
  for (Value v = 0; v < static_cast<Value>(home_.size()); ++v)
    if (has_home(v)) at_home_[{home_[v].base, home_[v].offset}].push_back(v);
}

void Places::release(int r) {
  if (holds_[r] >= 0) register_[holds_[r]] = -1;
  holds_[r] = -1;
}

int Places::load(Value v) {
  if (register_[v] < 0) {
    const int r = free_register();
    emit({.kind = Instruction::load, .to = static_cast<std::int8_t>(r), .at = place(v), .value = v});
    if (slot_[v] >= 0) ++out_.reloads;
    give(r, v);
  }
  pin(register_[v]);
  return register_[v];
}

int Places::free_register_or_none() {
  int best = -1;
  double farthest = -1.0;
  for (int r = 0; r < registers(); ++r) {
    if (pinned_[r]) continue;
    if (holds_[r] < 0) return r;
    const int next = uses_.next(holds_[r]);
    const double distance = (static_cast<double>(next) - uses_.now()) * (in_memory(holds_[r]) ? 1.0 : store_first);
    if (distance > farthest) farthest = distance, best = r;
  }
  if (best >= 0) push_out(best);
  return best;
}

int Places::free_register() {
  const int r = free_register_or_none();
  if (r < 0) throw std::logic_error("an operation needs more registers than there are");
  return r;
}

void Places::push_out(int r) {
  const Value v = holds_[r];
  if (v >= 0 && uses_.are_left(v) && !in_memory(v)) store_to_slot(v);
  release(r);
}

void Places::push_all_out() {
  for (int r = 0; r < registers(); ++r) push_out(r);
}

int Places::overwritten(Value v) {
  if (!in_memory(v)) store_to_slot(v);
  return register_[v];
}

void Places::copy(Value to, Value from) {
  const int source = register_[from];
  if (source >= 0) pin(source);
  const auto r = static_cast<std::int8_t>(free_register());
  if (source >= 0)
    emit({.kind = Instruction::move, .to = r, .a = static_cast<std::int8_t>(source)});
  else
    emit({.kind = Instruction::load, .to = r, .at = place(from)});
  give(r, to);
}

void Places::rename(Value from, Value to) {
  slot_[to] = slot_[from], slot_[from] = -1;
  if (register_[from] >= 0) give(register_[from], to);
  register_[from] = -1;
}

void Places::used(Value v) {
  uses_.take(v);
  if (uses_.are_left(v)) return;
  if (register_[v] >= 0) release(register_[v]);
  if (slot_[v] >= 0) free_slot(slot_[v]);
  slot_[v] = -1;
}

int Places::take_slot() {
  if (free_slots_.empty()) return slots_++;
  const int slot = free_slots_.back();
  free_slots_.pop_back();
  return slot;
}

void Places::store_to_slot(Value v) {
  slot_[v] = take_slot();
  ++out_.spills;
  emit({.kind = Instruction::store, .a = static_cast<std::int8_t>(register_[v]), .at = slot(v)});
}

void Places::leave_home(Value v) {
  load(v);
  home_[v] = {};
  unpin();
}

void Places::leave(const Memory& at, Value written, int time) {
  const auto found = at_home_.find({at.base, at.offset});
  if (found == at_home_.end()) return;
  for (Value v : found->second)
    if (v != written && has_home(v) && uses_.are_left(v) && listing_.born[v] <= time) leave_home(v);
}

void Places::leave_all(int time) {
  for (Value v = 0; v < static_cast<Value>(home_.size()); ++v)
    if (has_home(v) && home_[v].base != Memory::handed && !listing_.fixed[v] && uses_.are_left(v) &&
        listing_.born[v] <= time)
      leave_home(v);
}

void Places::leave_handed(int time) {
  for (auto at = at_home_.lower_bound({Memory::handed, 0}); at != at_home_.end(); ++at)
    for (Value v : at->second)
      if (has_home(v) && uses_.are_left(v) && listing_.born[v] <= time) leave_home(v);
}

void Places::begin_subroutine(std::vector<Instruction>& code) {
  code_ = &code;
  for (int r = 0; r < registers(); ++r) release(r);
  free_slots_.clear();
}

}  // namespace lockstep::jit
