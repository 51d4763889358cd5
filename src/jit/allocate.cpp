// SPDX-License-Identifier: Apache-2.0
#include "allocate.h"

#include <algorithm>
#include <map>
#include <set>
#include <stdexcept>

#include "places.h"
#include "uses.h"

namespace lockstep::jit {
namespace {

std::int8_t number_of(int r) { return static_cast<std::int8_t>(r); }

class Allocation {
 public:
  Allocation(const Listing& listing, const Machine& machine)
      : listing_(listing), machine_(machine), uses_(listing), places_(listing, machine, uses_, out_) {}

  Allocated run() {
    const auto count = static_cast<int>(listing_.operations.size());
    int own = 0;                           // operations of the step without its subroutines
    int depth = 0, always = 0, begun = 0;  // of loops and scopes; of those outside them; of the part
    for (; own < count && listing_.operations[static_cast<std::size_t>(own)].op != Op::begin_subroutine; ++own) {
      const Op op = listing_.operations[static_cast<std::size_t>(own)].op;
      depth += begins(op) ? 1 : ends(op) ? -1 : 0;
      always += depth == 0;
    }
    const bool in_parts = always > machine_.longest;
    emit({.kind = Instruction::begin_part});
    for (int i = 0; i < own; ++i) {
      const Operation& operation = listing_.operations[static_cast<std::size_t>(i)];
      uses_.come_to(i);
      if (in_parts && depth == 0 && i - begun >= machine_.part) {
        places_.push_all_out();
        emit({.kind = Instruction::end_part});
        emit({.kind = Instruction::begin_part});
        ++out_.parts;
        begun = i;
      }
      depth += begins(operation.op) ? 1 : ends(operation.op) ? -1 : 0;
      take(operation);
      places_.unpin();
    }
    emit({.kind = Instruction::end_part});
    for (int i = own; i < count; ++i) {
      uses_.come_to(i);
      take(listing_.operations[static_cast<std::size_t>(i)]);
      places_.unpin();
    }
    out_.slots = places_.slots();
    out_.first_handed = places_.first_handed();
    return std::move(out_);
  }

 private:
  void emit(const Instruction& instruction) { places_.emit(instruction); }
  bool ends_here(Value v) const { return uses_.next_behind(v) == Uses::never; }

  void take(const Operation& o) {
    switch (o.op) {
      case Op::store: return store(o);
      case Op::assign: return assign(o);
      case Op::begin_loop: places_.push_all_out(); return emit({.kind = Instruction::begin_loop, .number = o.number});
      case Op::begin_unless:
      case Op::begin_scope: return begin_scope(o);
      case Op::end_loop:
      case Op::end_scope: return end(o);
      case Op::call:
        places_.leave_all(o.time);
        places_.push_all_out();
        return emit({.kind = Instruction::call, .number = static_cast<int>(call(o).stage)});
      case Op::call_if: return call_if(o);
      case Op::run: return run_subroutine(o);
      case Op::begin_subroutine:
        out_.subroutines.emplace_back();
        return places_.begin_subroutine(out_.subroutines.back());
      case Op::end_subroutine: return;
      case Op::copy: return copy(o);
      default: return compute(o);
    }
  }

  void store(const Operation& o) {
    places_.leave(o.at, o.from[0], o.time);
    emit({.kind = Instruction::store, .a = number_of(places_.load(o.from[0])), .at = o.at});
    places_.used(o.from[0]);
  }

  void assign(const Operation& o) {
    emit({.kind = Instruction::store, .a = number_of(places_.load(o.from[0])), .at = places_.slot(o.to)});
    if (const int r = places_.register_of(o.to); r >= 0) places_.release(r);
    places_.used(o.from[0]);
  }

  // A copy of a value that ends here is another name for it.
  void copy(const Operation& o) {
    const Value from = o.from[0];
    ends_here(from) && !places_.has_home(from) ? places_.rename(from, o.to) : places_.copy(o.to, from);
    places_.used(from);
  }

  void run_subroutine(const Operation& o) {
    const SubroutineRun& run = run_of(o);
    if (run.calls) places_.leave_all(o.time);
    for (const Memory& at : run.changes) places_.leave(at, -1, o.time);
    places_.push_all_out();
    emit({.kind = Instruction::run, .number = run.subroutine});
  }

  const SubroutineRun& run_of(const Operation& o) const { return listing_.runs[static_cast<std::size_t>(o.number)]; }

  // Memory that a scope may change holds no values behind its begin.
  void leave_what_changes_in_scope(const Operation& begin) {
    bool runs = false, calls = false;
    int depth = 0;
    auto i = static_cast<std::size_t>(uses_.now());
    do {
      const Operation& o = listing_.operations[i++];
      if (o.op == Op::run) runs = true, calls = calls || run_of(o).calls;
      depth += begins(o.op) ? 1 : ends(o.op) ? -1 : 0;
    } while (depth > 0);
    if (runs) places_.leave_handed(begin.time);
    if (calls) places_.leave_all(begin.time);
  }

  // All values that are needed in a scope or behind it are in memory where it begins and ends.
  void begin_scope(const Operation& o) {
    leave_what_changes_in_scope(o);
    const int r = places_.load(o.from[0]);
    for (int other = 0; other < places_.registers(); ++other)
      if (other != r) places_.push_out(other);
    places_.used(o.from[0]);
    places_.push_out(r);
    counters_.push_back(o.number > 1 ? places_.take_slot() : -1);
    emit({.kind = o.op == Op::begin_scope ? Instruction::begin_scope : Instruction::begin_unless,
          .a = number_of(r),
          .number = o.number,
          .at = counter()});
  }
  Memory counter() const { return counters_.back() < 0 ? Memory{} : places_.slot_number(counters_.back()); }

  void end(const Operation& o) {
    Instruction instruction{.kind = o.op == Op::end_loop ? Instruction::end_loop : Instruction::end_scope};
    if (o.from[0] >= 0) instruction.a = number_of(places_.load(o.from[0]));
    if (o.op == Op::end_scope) {
      instruction.at = counter();
      if (counters_.back() >= 0) places_.free_slot(counters_.back());
      counters_.pop_back();
    }
    emit(instruction);
    for (int r = 0; r < places_.registers(); ++r) places_.release(r);
    for (Value v = 0; v < static_cast<Value>(listing_.home.size()); ++v)
      if (uses_.is_used_now(v)) places_.used(v);
  }

  const StageCall& call(const Operation& o) const { return listing_.calls[static_cast<std::size_t>(o.number)]; }

  void call_if(const Operation& o) {
    const StageCall& stage = call(o);
    places_.leave_all(o.time);
    std::map<Value, int> starts;
    for (const StageCall::Variable& variable : stage.variables) ++starts[variable.before];
    std::map<Value, Value> renamed;
    for (const auto& [at, before, after] : stage.variables) {
      if (!uses_.exist(after)) continue;
      if (ends_here(before) && starts[before] == 1 && !places_.has_home(before))
        renamed[before] = after, places_.rename(before, after);
      else
        places_.copy(after, before);
      places_.unpin();
    }
    const auto now = [&](Value v) {
      const auto found = renamed.find(v);
      return found == renamed.end() ? v : found->second;
    };
    const int condition = places_.load(now(o.from[0]));
    emit({.kind = Instruction::if_any, .a = number_of(condition), .number = static_cast<int>(out_.cold.size())});
    out_.cold.push_back(rare_part(stage, now));
    places_.used(o.from[0]);
    for (const StageCall::Write& write : stage.writes) places_.used(write.value);
    for (const StageCall::Variable& variable : stage.variables) places_.used(variable.before);
  }

  // Saves the registers, writes to the tile, calls, and reads back. Register 0 carries what is in no register.
  template <class Now>
  std::vector<Instruction> rare_part(const StageCall& stage, Now now) const {
    std::vector<Instruction> code, restored;
    const auto load_to = [&](int r, Memory at) {
      code.push_back({.kind = Instruction::load, .to = number_of(r), .at = at});
    };
    const auto store_from = [&](int r, Memory at) {
      code.push_back({.kind = Instruction::store, .a = number_of(r), .at = at});
    };
    std::set<Value> variables;
    for (const StageCall::Variable& variable : stage.variables) variables.insert(variable.after);
    for (int r = 0; r < places_.registers(); ++r) {
      const Value v = places_.held_by(r);
      if (v < 0 || variables.contains(v) || !uses_.are_left_behind(v)) continue;
      const Memory saved = places_.in_memory(v) ? places_.place(v) : places_.cold_slot(r);
      if (!places_.in_memory(v)) store_from(r, saved);
      restored.push_back({.kind = Instruction::load, .to = number_of(r), .at = saved});
    }
    std::vector<StageCall::Write> writes = stage.writes;
    for (const StageCall::Variable& variable : stage.variables) writes.push_back({variable.at, variable.before});
    for (const StageCall::Write& write : writes)
      if (const int r = places_.register_of(now(write.value)); r >= 0) store_from(r, write.at);
    for (const StageCall::Write& write : writes)
      if (const Value v = now(write.value); places_.register_of(v) < 0)
        load_to(0, places_.place(v)), store_from(0, write.at);
    code.push_back({.kind = Instruction::call, .number = static_cast<int>(stage.stage)});
    for (const StageCall::Variable& variable : stage.variables)
      if (uses_.exist(variable.after) && places_.has_slot(variable.after))
        load_to(0, variable.at), store_from(0, places_.slot(variable.after));
    for (const StageCall::Variable& variable : stage.variables)
      if (const int r = places_.register_of(variable.after); r >= 0) load_to(r, variable.at);
    code.insert(code.end(), restored.begin(), restored.end());
    code.push_back({.kind = Instruction::resume, .number = static_cast<int>(out_.cold.size())});
    return code;
  }

  void compute(const Operation& o) {
    const int n = operands(o.op);
    const int memory = operand_in_memory(o);
    for (int i = 0; i < n; ++i)
      if (const int r = places_.register_of(o.from[i]); r >= 0) places_.pin(r);
    for (int i = 0; i < n; ++i)
      if (i != memory) places_.load(o.from[i]);
    const bool overwrites = n == 3 && (o.op != Op::select || machine_.avx512());
    const int to = overwrites ? overwrite(o, memory) : keep(o, memory);
    places_.last().value = o.to;
    places_.release(to);
    for (int i = 0; i < n; ++i) places_.used(o.from[i]);
    places_.give(to, o.to);
  }

  // The operand that may stand in memory, -1 if none.
  int operand_in_memory(const Operation& o) const {
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
      if (places_.register_of(v) >= 0 || !may(i) || std::count(o.from.begin(), o.from.end(), v) > 1) continue;
      if (best < 0 || uses_.next_behind(v) > uses_.next_behind(o.from[best])) best = i;
    }
    if (best < 0 || ends_here(o.from[best])) return best;
    for (int r = 0; r < places_.registers(); ++r) {
      const Value v = places_.held_by(r);
      if (v < 0) return -1;
      if (std::find(o.from.begin(), o.from.end(), v) != o.from.end()) continue;
      if (places_.in_memory(v) && uses_.next(v) > uses_.next_behind(o.from[best])) return -1;
    }
    return best;
  }

  Memory place_of(const Operation& o, int operand) const {
    return operand < 0 ? Memory{} : places_.place(o.from[operand]);
  }

  // An instruction with a register of its own for the result. Returns that.
  int keep(const Operation& o, int memory) {
    const int n = operands(o.op);
    std::array<Value, 3> from = o.from;
    if (n == 2 && memory == 0) std::swap(from[0], from[1]);
    Instruction instruction{.op = o.op, .in_memory = memory >= 0, .number = o.number, .at = place_of(o, memory)};
    const auto in = [&](Value v) { return number_of(places_.register_of(v)); };
    if (n == 3)  // select: where the mask is not, then where it is
      instruction.a = in(from[2]), instruction.b = in(from[1]), instruction.c = in(from[0]);
    else
      instruction.a = in(from[0]), instruction.b = n == 2 ? in(from[1]) : number_of(-1);
    const int to = result(o);
    instruction.to = number_of(to);
    emit(instruction);
    return to;
  }

  // The register of an operand that ends here, else a free one, else that of an operand, which goes to its slot.
  int result(const Operation& o) {
    for (int i = 0; i < operands(o.op); ++i)
      if (const int r = places_.register_of(o.from[i]); r >= 0 && ends_here(o.from[i])) return r;
    const int r = places_.free_register_or_none();
    return r >= 0 ? r : places_.overwritten(o.from[0]);
  }

  // An instruction that overwrites one of its three operands. Returns the register.
  int overwrite(const Operation& o, int memory) {
    std::array<int, 3> in;
    for (int i = 0; i < 3; ++i) in[i] = places_.register_of(o.from[i]);
    const Memory at = place_of(o, memory);
    // The operand that is overwritten: one that ends here, the summand first; else the one in memory; else the summand.
    int over = -1;
    for (int i : {2, 0, 1})
      if (over < 0 && i != memory && ends_here(o.from[i])) over = i;
    const bool is_fused = o.op != Op::select && o.op != Op::differ3;
    int to;
    if (over >= 0) {
      to = in[over];
    } else {
      over = memory >= 0 ? memory : 2;
      to = places_.free_register_or_none();
      if (to < 0) {  // an operand gives up its register
        over = memory == 2 ? 0 : 2;
        to = places_.overwritten(o.from[over]);
      } else if (memory >= 0) {
        emit({.kind = Instruction::load, .to = number_of(to), .at = at});
        memory = -1;
      } else {
        emit({.kind = Instruction::move, .to = number_of(to), .a = number_of(in[over])});
      }
    }
    in[over] = to;
    // The other two, the one in memory last.
    int second = over == 0 ? 1 : 0, third = over == 2 ? 1 : 2;
    if (memory == second) std::swap(second, third);
    Instruction instruction{.kind = is_fused ? Instruction::fused : Instruction::ternary,
                            .op = o.op,
                            .to = number_of(to),
                            .a = number_of(in[second]),
                            .b = number_of(in[third]),
                            .in_memory = memory >= 0,
                            .at = at};
    if (is_fused)
      instruction.number = over == 2 ? 231 : third == 2 ? 213 : 132;
    else
      instruction.number = table(o.op, over, second, third);
    emit(instruction);
    return to;
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

  const Listing& listing_;
  const Machine& machine_;
  Allocated out_;
  Uses uses_;
  Places places_;
  std::vector<int> counters_;  // of open scopes: their slots, -1 if they are not repeated
};

}  // namespace

Allocated allocate(const Listing& listing, const Machine& machine) { return Allocation(listing, machine).run(); }

}  // namespace lockstep::jit
