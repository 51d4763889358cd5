// Allocates slots and encodes a list. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <stdexcept>

#include "draft.h"
#include "run.h"

namespace lockstep::interpret {
namespace {

class Slots {
 public:
  explicit Slots(const DraftList& draft)
      : draft_(draft),
        slot_(static_cast<std::size_t>(draft.values), none),
        last_use_(slot_.size(), -1),
        in_register_(slot_.size(), false) {
    for (const DraftOp& constant : draft.constants_first) slot_[constant.to] = count_++;
    for (const MemoryAccess& read : draft.before) slot_[read.value] = count_++;
    lasting_ = count_;
    for (int i = 0; i < static_cast<int>(draft.operations.size()); ++i) {
      const DraftOp& operation = draft.operations[i];
      each_use(operation, [&](Value v) { last_use_[v] = i; });
      if (operation.last != Last::none) in_register_[operation.from[static_cast<int>(operation.last) - 1]] = true;
    }
  }

  int count() const { return count_; }
  bool has(Value v) const { return v >= 0 && !in_register_[v]; }
  int of(Value v) const { return slot_[v]; }

  // Frees the slots of values that operation i is the last to use, and assigns slots to its results.
  void advance_to(int i) {
    const DraftOp& operation = draft_.operations[i];
    each_use(operation, [&](Value v) {
      if (last_use_[v] == i) release(v);
    });
    const Value results[] = {operation.to, operation.also_to};
    for (Value v : results) assign(v);
    for (Value v : results)
      if (has(v) && last_use_[v] < 0) release(v);
  }

 private:
  static constexpr int none = -1;

  void release(Value v) {
    if (!has(v) || slot_[v] < lasting_) return;
    if (std::find(free_.begin(), free_.end(), slot_[v]) == free_.end()) free_.push_back(slot_[v]);
  }
  void assign(Value v) {
    if (!has(v) || slot_[v] != none) return;
    if (free_.empty()) free_.push_back(count_++);
    slot_[v] = free_.back();
    free_.pop_back();
  }

  const DraftList& draft_;
  std::vector<int> slot_, last_use_, free_;  // by value, by value; the slot freed last is in the cache
  std::vector<char> in_register_;            // by value: it has no slot
  int count_ = 0, lasting_;                  // slots below lasting_ are not shared
};

std::uint16_t as_uint16(std::size_t number) {
  if (number > 0xffff) throw std::length_error("an index of a list does not fit into 16 bits");
  return static_cast<std::uint16_t>(number);
}

class Encoder {
 public:
  explicit Encoder(const DraftList& draft) : slots_(draft) {
    for (const DraftOp& constant : draft.constants_first) constants_first_.push_back(operation(constant));
    for (std::size_t i = 0; i < draft.operations.size(); ++i) {
      slots_.advance_to(static_cast<int>(i));
      step_.push_back(operation(draft.operations[i]));
    }
    for (std::vector<Operation>* list : {&constants_first_, &step_})
      list->push_back(operation({.opcode = Opcode::end}));
    find_superoperators();
  }

  OperationList keep(const DraftList& draft, TableStorage& storage) {
    const auto accesses_of = [&](const std::vector<MemoryAccess>& accesses) {
      std::vector<Access> all;
      for (const MemoryAccess& one : accesses) all.push_back(access(one));
      return storage.keep(std::move(all));
    };
    return {.constants_first = storage.keep(std::move(constants_first_)),
            .before = accesses_of(draft.before),
            .step = storage.keep(std::move(step_)),
            .after = accesses_of(draft.after),
            .apart = draft.apart,
            .constants = storage.keep(std::vector(draft.constants)),
            .accesses = storage.keep(std::move(accesses_)),
            .slots = slots_.count()};
  }

 private:
  Operation operation(const DraftOp& draft) {
    const auto slot = [&](Value v) {
      return slots_.has(v) ? as_uint16(static_cast<std::size_t>(slots_.of(v))) : std::uint16_t{0};
    };
    const Encoding encoding{draft.opcode, draft.last, is_arithmetic(draft.opcode) && slots_.has(draft.to)};
    Operation o{.encoding = as_uint16(static_cast<std::size_t>(encoding.number())),
                .to = slot(draft.to),
                .a = slot(draft.from[0]),
                .b = slot(draft.from[1]),
                .c = slot(draft.from[2]),
                .d = 0};
    if (draft.constant >= 0) o.a = as_uint16(static_cast<std::size_t>(draft.constant));
    switch (draft.opcode) {
      case Opcode::sincos: o.c = slot(draft.also_to); break;
      case Opcode::read:
      case Opcode::write:
        o.a = accesses_so_far();
        add(draft.reads), add(draft.writes);
        break;
      case Opcode::call: o.a = static_cast<std::uint16_t>(draft.call); break;
      case Opcode::call_if:
        o.to = slot(draft.from[0]), o.d = static_cast<std::uint16_t>(draft.call);
        o.a = accesses_so_far(), add(draft.writes);
        o.b = accesses_so_far(), add(draft.reads);
        o.c = accesses_so_far();
        break;
      default: break;
    }
    return o;
  }

  std::uint16_t accesses_so_far() const { return as_uint16(accesses_.size()); }
  void add(const std::vector<MemoryAccess>& accesses) {
    for (const MemoryAccess& one : accesses) accesses_.push_back(access(one));
  }
  Access access(const MemoryAccess& one) const {
    const bool fits = one.place.array < kernels::Places::most || one.place.array >= Access::first_row;
    if (!fits) throw std::logic_error("a tile has more arrays than the interpreter can name: see kernels::Places");
    return {slots_.of(one.value), one.place.array, one.place.number};
  }

  void find_superoperators() {
    const auto is = [](const Operation& o, Encoding encoding) { return o.encoding == encoding.number(); };
    for (std::size_t i = 0; i + 1 < step_.size(); ++i)
      for (int index = 0; index < Superoperator::count; ++index) {
        const auto pair = Superoperator::of(index);
        if (!is(step_[i], pair.first) || !is(step_[i + 1], pair.second)) continue;
        step_[i++].encoding = static_cast<std::uint16_t>(single_encodings + index);
        break;
      }
  }

  Slots slots_;
  std::vector<Operation> constants_first_, step_;
  std::vector<Access> accesses_;
};

}  // namespace

OperationList allocate_slots(const DraftList& draft, TableStorage& storage) {
  return Encoder(draft).keep(draft, storage);
}

}  // namespace lockstep::interpret
