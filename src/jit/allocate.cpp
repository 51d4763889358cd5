// SPDX-License-Identifier: Apache-2.0
#include "allocate.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

namespace lockstep::jit {
namespace {

constexpr int never = std::numeric_limits<int>::max();
constexpr int rare = 100000;         // operations by which a use in a rare part counts as later
constexpr double store_first = 0.5;  // weight of the distance of a value that must be stored

class Allocation {
 public:
  Allocation(const Listing& listing, const Machine& machine)
      : listing_(listing),
        machine_(machine),
        home_(listing.home),
        register_(home_.size(), -1),
        slot_(home_.size(), -1),
        holds_(static_cast<std::size_t>(machine.registers), -1),
        pinned_(holds_.size(), false) {}

  Allocated run() {
    find_uses();
    for (Value v = 0; v < static_cast<Value>(home_.size()); ++v)
      if (home_[v].base != Memory::none) at_home_[{home_[v].base, home_[v].offset}].push_back(v);
    const bool in_parts = static_cast<int>(listing_.operations.size()) > machine_.longest;
    emit({.kind = Instruction::begin_part});
    int depth = 0, begun = 0;  // of loops and scopes; of the part
    for (now_ = 0; now_ < static_cast<int>(listing_.operations.size()); ++now_) {
      const Operation& operation = listing_.operations[now_];
      if (in_parts && depth == 0 && now_ - begun >= machine_.part) {
        empty_registers();
        emit({.kind = Instruction::end_part});
        emit({.kind = Instruction::begin_part});
        ++out_.parts;
        begun = now_;
      }
      depth += begins(operation.op) ? 1 : ends(operation.op) ? -1 : 0;
      take(operation);
      std::fill(pinned_.begin(), pinned_.end(), false);
    }
    emit({.kind = Instruction::end_part});
    out_.slots = first_slot() + slots_;
    return std::move(out_);
  }

 private:
  struct Use {
    int at;
    bool rare;
  };

  // Uses.

  void find_uses() {
    uses_.resize(home_.size());
    next_.assign(home_.size(), 0);
    std::vector<int> defined(home_.size(), -1);
    // Loops that are open, and the values from before them that each of their turns needs.
    struct Loop {
      int begin;
      bool repeats;
      std::set<Value> through;
    };
    std::vector<Loop> loops;
    for (int i = 0; i < static_cast<int>(listing_.operations.size()); ++i) {
      const Operation& o = listing_.operations[i];
      const auto use = [&](Value v, bool is_rare) {
        for (Loop& loop : loops)
          if (loop.repeats && defined[v] < loop.begin && !listing_.fixed[v]) loop.through.insert(v);
        if (!uses_[v].empty() && uses_[v].back().at == i)
          uses_[v].back().rare = uses_[v].back().rare && is_rare;
        else
          uses_[v].push_back({i, is_rare});
      };
      for (Value v : o.from)
        if (v >= 0) use(v, false);
      if (o.op == Op::assign) loops.back().through.insert(o.to);
      if (o.op == Op::call || o.op == Op::call_if) {
        for (const StageCall::Variable& variable : call(o).variables) {
          use(variable.before, false);
          defined[variable.after] = i;
        }
        for (const StageCall::Write& write : call(o).writes) use(write.value, true);
      }
      if (begins(o.op)) loops.push_back({i, o.number > 1, {}});
      if (ends(o.op)) {
        const std::set<Value> through = std::move(loops.back().through);
        loops.pop_back();
        for (Value v : through) use(v, false);
      }
      if (has_result(o.op)) defined[o.to] = i;
    }
  }

  const StageCall& call(const Operation& o) const { return listing_.calls[static_cast<std::size_t>(o.number)]; }

  // The next use from operation `now` on.
  int next_use(Value v) const {
    int soonest = never;
    for (std::size_t u = next_[v]; u < uses_[v].size(); ++u) {
      const Use& use = uses_[v][u];
      soonest = std::min(soonest, use.rare ? use.at + rare : use.at);
      if (!use.rare) break;
    }
    return soonest;
  }
  bool is_needed(Value v) const { return next_[v] < uses_[v].size(); }
  bool is_needed_later(Value v) const { return is_needed(v) && uses_[v].back().at > now_; }

  // The instruction that uses the value has been emitted. Its register and slot are free if this was the last use.
  void used(Value v) {
    if (is_needed(v) && uses_[v][next_[v]].at == now_) ++next_[v];
    if (!is_needed(v)) forget(v);
  }
  void forget(Value v) {
    if (register_[v] >= 0) holds_[register_[v]] = -1;
    register_[v] = -1;
    if (slot_[v] >= 0) free_slots_.push_back(slot_[v]);
    slot_[v] = -1;
  }

  // Memory.

  int first_cold_slot() const { return 1 + static_cast<int>(listing_.rows.size()); }
  int first_slot() const { return first_cold_slot() + machine_.registers; }
  Memory slot_number(int number) const { return {Memory::slots, number * machine_.register_bytes}; }
  Memory slot(Value v) const { return slot_number(first_slot() + slot_[v]); }
  bool in_memory(Value v) const { return slot_[v] >= 0 || home_[v].base != Memory::none; }
  Memory place(Value v) const { return slot_[v] >= 0 ? slot(v) : home_[v]; }

  void store_to_slot(Value v) {
    if (free_slots_.empty())
      slot_[v] = slots_++;
    else
      slot_[v] = free_slots_.back(), free_slots_.pop_back();
    ++out_.spills;
    emit({.kind = Instruction::store, .a = static_cast<std::int8_t>(register_[v]), .at = slot(v)});
  }

  // The memory `at` is about to change. A value that is still needed leaves it.
  void leave(const Memory& at, Value written, int time) {
    const auto found = at_home_.find({at.base, at.offset});
    if (found == at_home_.end()) return;
    for (Value v : found->second) {
      if (v == written || !is_needed(v) || listing_.born[v] > time) continue;
      load(v);
      home_[v] = {};
    }
  }

  // Registers.

  void emit(const Instruction& instruction) { out_.instructions.push_back(instruction); }

  void pin(int r) { pinned_[r] = true; }

  // A register that holds nothing. -1 if all are pinned.
  int try_free_register() {
    int best = -1;
    double farthest = -1.0;
    for (int r = 0; r < machine_.registers; ++r) {
      if (pinned_[r]) continue;
      if (holds_[r] < 0) return r;
      const int next = next_use(holds_[r]);
      const double distance = (static_cast<double>(next) - now_) * (in_memory(holds_[r]) ? 1.0 : store_first);
      if (distance > farthest) farthest = distance, best = r;
    }
    if (best >= 0) push_out(best);
    return best;
  }
  void push_out(int r) {
    const Value v = holds_[r];
    if (is_needed(v) && !in_memory(v)) store_to_slot(v);
    register_[v] = -1, holds_[r] = -1;
  }
  int free_register() {
    const int r = try_free_register();
    if (r < 0) throw std::logic_error("an operation needs more registers than there are");
    return r;
  }

  void give(int r, Value v) { register_[v] = r, holds_[r] = v; }

  int load(Value v) {
    if (register_[v] < 0) {
      const int r = free_register();
      emit({.kind = Instruction::load, .to = static_cast<std::int8_t>(r), .at = place(v), .value = v});
      if (slot_[v] >= 0) ++out_.reloads;
      give(r, v);
    }
    pin(register_[v]);
    return register_[v];
  }

  // All values that are still needed go to memory.
  void empty_registers() {
    for (int r = 0; r < machine_.registers; ++r)
      if (holds_[r] >= 0) push_out(r);
  }

  // Operations.

  void take(const Operation& o) {
    switch (o.op) {
      case Op::store: {
        leave(o.at, o.from[0], o.time);
        const int r = load(o.from[0]);
        emit({.kind = Instruction::store, .a = static_cast<std::int8_t>(r), .at = o.at});
        return used(o.from[0]);
      }
      case Op::assign: {
        const int r = load(o.from[0]);
        emit({.kind = Instruction::store, .a = static_cast<std::int8_t>(r), .at = slot(o.to)});
        if (register_[o.to] >= 0) holds_[register_[o.to]] = -1, register_[o.to] = -1;
        return used(o.from[0]);
      }
      case Op::begin_loop: empty_registers(); return emit({.kind = Instruction::begin_loop, .number = o.number});
      case Op::begin_unless:
      case Op::begin_scope: return begin_scope(o);
      case Op::end_loop:
      case Op::end_scope: return end(o);
      case Op::call: return always_call(o);
      case Op::call_if: return call_if(o);
      case Op::copy: return copy(o);
      default: return compute(o);
    }
  }

  // All values that are needed in a scope or behind it are in memory where it begins and ends.
  void begin_scope(const Operation& o) {
    const int r = load(o.from[0]);
    for (int other = 0; other < machine_.registers; ++other)
      if (other != r && holds_[other] >= 0) push_out(other);
    used(o.from[0]);
    if (holds_[r] >= 0) push_out(r);
    Memory counter;
    if (o.number > 1) counter = slot_number(first_slot() + slots_++);
    counters_.push_back(counter);
    emit({.kind = o.op == Op::begin_scope ? Instruction::begin_scope : Instruction::begin_unless,
          .a = static_cast<std::int8_t>(r),
          .number = o.number,
          .at = counter});
  }

  void end(const Operation& o) {
    Instruction instruction{.kind = o.op == Op::end_loop ? Instruction::end_loop : Instruction::end_scope};
    if (o.from[0] >= 0) instruction.a = static_cast<std::int8_t>(load(o.from[0]));
    if (o.op == Op::end_scope) instruction.at = counters_.back(), counters_.pop_back();
    emit(instruction);
    for (Value& v : holds_)
      if (v >= 0) register_[v] = -1, v = -1;
    for (Value v = 0; v < static_cast<Value>(uses_.size()); ++v)
      if (is_needed(v) && uses_[v][next_[v]].at == now_) used(v);
  }

  void always_call(const Operation& o) {
    for (Value v = 0; v < static_cast<Value>(home_.size()); ++v) {
      if (home_[v].base == Memory::none || listing_.fixed[v] || !is_needed(v) || listing_.born[v] > o.time) continue;
      load(v);
      home_[v] = {};
      std::fill(pinned_.begin(), pinned_.end(), false);
    }
    empty_registers();
    emit({.kind = Instruction::call, .number = static_cast<int>(call(o).stage)});
  }

  void call_if(const Operation& o) {
    const StageCall& stage = call(o);
    std::map<Value, int> starts;
    for (const StageCall::Variable& variable : stage.variables) ++starts[variable.before];
    std::map<Value, Value> renamed;
    for (const StageCall::Variable& variable : stage.variables) {
      const auto [at, before, after] = variable;
      if (uses_[after].empty()) continue;
      const bool ends = !is_needed_later(before) && starts[before] == 1 && home_[before].base == Memory::none;
      if (ends) {
        renamed[before] = after;
        rename(before, after);
      } else {
        copy_to(after, before);
      }
      std::fill(pinned_.begin(), pinned_.end(), false);
    }
    const auto now = [&](Value v) {
      const auto found = renamed.find(v);
      return found == renamed.end() ? v : found->second;
    };
    for (const StageCall::Write& write : stage.writes) leave(write.at, write.value, o.time), unpin();
    for (const StageCall::Variable& variable : stage.variables) leave(variable.at, variable.before, o.time), unpin();
    const int condition = load(now(o.from[0]));
    emit({.kind = Instruction::if_any,
          .a = static_cast<std::int8_t>(condition),
          .number = static_cast<int>(out_.cold.size())});
    out_.cold.push_back(cold_part(stage, now));
    std::vector<Value> all(o.from.begin(), o.from.begin() + 1);
    for (const StageCall::Write& write : stage.writes) all.push_back(write.value);
    for (const StageCall::Variable& variable : stage.variables) all.push_back(variable.before);
    for (Value v : all) used(v);
  }
  void unpin() { std::fill(pinned_.begin(), pinned_.end(), false); }

  void copy_to(Value to, Value from) {
    if (register_[from] >= 0) pin(register_[from]);
    const int r = free_register();
    if (register_[from] >= 0)
      emit({.kind = Instruction::move,
            .to = static_cast<std::int8_t>(r),
            .a = static_cast<std::int8_t>(register_[from])});
    else
      emit({.kind = Instruction::load, .to = static_cast<std::int8_t>(r), .at = place(from)});
    give(r, to);
  }

  template <class Now>
  std::vector<Instruction> cold_part(const StageCall& stage, Now now) {
    std::vector<Instruction> cold, restored;
    const auto load_to = [&](int r, Memory at) {
      cold.push_back({.kind = Instruction::load, .to = static_cast<std::int8_t>(r), .at = at});
    };
    const auto store_from = [&](int r, Memory at) {
      cold.push_back({.kind = Instruction::store, .a = static_cast<std::int8_t>(r), .at = at});
    };
    std::set<Value> variables;
    for (const StageCall::Variable& variable : stage.variables) variables.insert(variable.after);
    for (int r = 0; r < machine_.registers; ++r) {
      const Value v = holds_[r];
      if (v < 0 || variables.contains(v) || !is_needed_later(v)) continue;
      const Memory saved = in_memory(v) ? place(v) : slot_number(first_cold_slot() + r);
      if (!in_memory(v)) store_from(r, saved);
      restored.push_back({.kind = Instruction::load, .to = static_cast<std::int8_t>(r), .at = saved});
    }
    std::vector<StageCall::Write> writes = stage.writes;
    for (const StageCall::Variable& variable : stage.variables) writes.push_back({variable.at, variable.before});
    for (const StageCall::Write& write : writes)
      if (const int r = register_[now(write.value)]; r >= 0) store_from(r, write.at);
    for (const StageCall::Write& write : writes)
      if (const Value v = now(write.value); register_[v] < 0 && !(place(v) == write.at))
        load_to(0, place(v)), store_from(0, write.at);
    cold.push_back({.kind = Instruction::call, .number = static_cast<int>(stage.stage)});
    for (const StageCall::Variable& variable : stage.variables) {
      const Value v = variable.after;
      if (uses_[v].empty() || slot_[v] < 0) continue;
      load_to(0, variable.at), store_from(0, slot(v));
    }
    for (const StageCall::Variable& variable : stage.variables)
      if (const int r = register_[variable.after]; r >= 0) load_to(r, variable.at);
    cold.insert(cold.end(), restored.begin(), restored.end());
    cold.push_back({.kind = Instruction::resume, .number = static_cast<int>(out_.cold.size())});
    return cold;
  }

  // The operand that may stand in memory, -1 if none.
  int operand_in_memory(const Operation& o) {
    const auto may = [&](int i) {
      switch (o.op) {
        case Op::sqrt: return true;
        case Op::shift_left:
        case Op::spread_sign: return false;
        case Op::select: return machine_.avx512() || i == 1;
        default: return operands(o.op) == 3 || i == 1 || commutes(o.op);
      }
    };
    int best = -1;
    for (int i = 0; i < operands(o.op); ++i) {
      const Value v = o.from[i];
      if (register_[v] >= 0 || !may(i) || std::count(o.from.begin(), o.from.end(), v) > 1) continue;
      if (best < 0 || after(v) > after(o.from[best])) best = i;
    }
    if (best < 0 || after(o.from[best]) == never) return best;
    for (int r = 0; r < machine_.registers; ++r) {
      const Value v = holds_[r];
      if (v < 0) return -1;
      if (std::find(o.from.begin(), o.from.end(), v) != o.from.end()) continue;
      if (in_memory(v) && next_use(v) > after(o.from[best])) return -1;
    }
    return best;
  }
  // The next use behind this operation.
  int after(Value v) const {
    for (std::size_t u = next_[v]; u < uses_[v].size(); ++u)
      if (uses_[v][u].at > now_) return uses_[v][u].rare ? uses_[v][u].at + rare : uses_[v][u].at;
    return never;
  }

  // A copy of a value that ends here is another name for it.
  void copy(const Operation& o) {
    const Value from = o.from[0];
    if (after(from) != never || home_[from].base != Memory::none) {
      copy_to(o.to, from);
    } else {
      rename(from, o.to);
    }
    used(from);
  }
  void rename(Value from, Value to) {
    slot_[to] = slot_[from], slot_[from] = -1;
    if (register_[from] >= 0) give(register_[from], to);
    register_[from] = -1;
  }

  void compute(const Operation& o) {
    const int n = operands(o.op);
    const int memory = operand_in_memory(o);
    for (int i = 0; i < n; ++i)
      if (register_[o.from[i]] >= 0) pin(register_[o.from[i]]);
    for (int i = 0; i < n; ++i)
      if (i != memory) load(o.from[i]);
    const bool overwrites = n == 3 && (o.op != Op::select || machine_.avx512());
    overwrites ? overwrite(o, memory) : keep(o, memory);
    holds(o);
  }

  Memory place_of(const Operation& o, int operand) const { return operand < 0 ? Memory{} : place(o.from[operand]); }

  // An instruction with a register of its own for the result.
  void keep(const Operation& o, int memory) {
    const int n = operands(o.op);
    std::array<Value, 3> from = o.from;
    if (n == 2 && memory == 0) std::swap(from[0], from[1]);
    Instruction instruction{.op = o.op, .in_memory = memory >= 0, .number = o.number, .at = place_of(o, memory)};
    const auto in = [&](Value v) { return static_cast<std::int8_t>(register_[v]); };
    if (n == 1) {
      instruction.a = in(from[0]);
    } else if (n == 2) {
      instruction.a = in(from[0]), instruction.b = in(from[1]);
    } else {  // select: where the mask is not, then where it is
      instruction.a = in(from[2]), instruction.b = in(from[1]), instruction.c = in(from[0]);
    }
    instruction.to = static_cast<std::int8_t>(result(o));
    emit(instruction);
  }

  // The register of an operand that ends here, else a free one, else that of an operand, which goes to its slot.
  int result(const Operation& o) {
    for (int i = 0; i < operands(o.op); ++i)
      if (register_[o.from[i]] >= 0 && after(o.from[i]) == never) return register_[o.from[i]];
    if (const int r = try_free_register(); r >= 0) return r;
    return taken_from(o.from[0]);
  }
  int taken_from(Value operand) {
    const int r = register_[operand];
    if (!in_memory(operand)) store_to_slot(operand);
    return r;
  }

  // An instruction that overwrites one of its three operands.
  void overwrite(const Operation& o, int memory) {
    std::array<int, 3> in;
    for (int i = 0; i < 3; ++i) in[i] = register_[o.from[i]];
    const Memory at = place_of(o, memory);
    // The operand that is overwritten: one that ends here, the summand first; else the one in memory; else the summand.
    int over = -1;
    for (int i : {2, 0, 1})
      if (over < 0 && i != memory && after(o.from[i]) == never) over = i;
    const bool is_fused = o.op != Op::select && o.op != Op::differ3;
    int to;
    if (over >= 0) {
      to = in[over];
    } else {
      over = memory >= 0 ? memory : 2;
      to = try_free_register();
      if (to < 0) {  // an operand gives up its register
        over = memory == 2 ? 0 : 2;
        to = taken_from(o.from[over]);
      } else if (memory >= 0) {
        emit({.kind = Instruction::load, .to = static_cast<std::int8_t>(to), .at = at});
        memory = -1;
      } else {
        emit({.kind = Instruction::move, .to = static_cast<std::int8_t>(to), .a = static_cast<std::int8_t>(in[over])});
      }
    }
    in[over] = to;
    // The other two, the one in memory last.
    int second = over == 0 ? 1 : 0, third = over == 2 ? 1 : 2;
    if (memory == second) std::swap(second, third);
    Instruction instruction{.kind = is_fused ? Instruction::fused : Instruction::ternary,
                            .op = o.op,
                            .to = static_cast<std::int8_t>(to),
                            .a = static_cast<std::int8_t>(in[second]),
                            .b = static_cast<std::int8_t>(in[third]),
                            .in_memory = memory >= 0,
                            .at = at};
    if (is_fused)
      instruction.number = over == 2 ? 231 : third == 2 ? 213 : 132;
    else
      instruction.number = table(o.op, over, second, third);
    emit(instruction);
  }

  // The table of a bitwise function: by the bits of its overwritten, second and third operand.
  static int table(Op op, int over, int second, int third) {
    int bits = 0;
    for (int row = 0; row < 8; ++row) {
      std::array<int, 3> value{};
      value[over] = row >> 2 & 1, value[second] = row >> 1 & 1, value[third] = row & 1;
      const int is = op == Op::select ? value[value[0] ? 1 : 2] : value[0] ^ value[1] ^ value[2];
      bits |= is << row;
    }
    return bits;
  }

  // After the instruction: operands are used, and the register that it has written holds the result.
  void holds(const Operation& o) {
    const int to = out_.instructions.back().to;
    out_.instructions.back().value = o.to;
    if (holds_[to] >= 0) register_[holds_[to]] = -1, holds_[to] = -1;
    for (int i = 0; i < operands(o.op); ++i) used(o.from[i]);
    give(to, o.to);
  }

  const Listing& listing_;
  const Machine& machine_;
  std::vector<std::vector<Use>> uses_;  // by value
  std::vector<std::size_t> next_;       // by value: its next use
  std::vector<Memory> home_;            // by value
  std::map<std::pair<int, int>, std::vector<Value>> at_home_;
  std::vector<int> register_, slot_;  // by value
  std::vector<Value> holds_;          // by register
  std::vector<char> pinned_;          // by register
  std::vector<int> free_slots_;
  std::vector<Memory> counters_;  // of open scopes
  int slots_ = 0, now_ = 0;
  Allocated out_;
};

}  // namespace

Allocated allocate(const Listing& listing, const Machine& machine) { return Allocation(listing, machine).run(); }

}  // namespace lockstep::jit
