// SPDX-License-Identifier: Apache-2.0
#include "lower.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>

#include "simd/sincos.h"
#include "trace/liveness.h"

namespace lockstep::jit {

using trace::Graph, trace::Id, trace::Item, trace::Node, trace::Place;

namespace {

constexpr int deepest = 5;  // single uses that are computed where they are used

template <class S>
class Lowering {
 public:
  Lowering(const Graph& graph, const TilePlaces& places, const Machine& machine, const std::vector<Access>& rows)
      : places_(places), machine_(machine), subroutines_(graph.subroutines) {
    for (const Access& row : rows) row_.emplace(std::pair{row.array, row.number}, static_cast<int>(row_.size()));
    out_.rows = rows;
    begin(graph);
  }

  Listing run() {
    if (places_.arrays > TilePlaces::most_arrays)
      throw std::length_error("a tile has too many arrays for machine code");
    put_all();
    for (std::size_t s = 0; s < subroutines_.size(); ++s) {
      begin(*subroutines_[s]);
      out_.operations.push_back({.op = Op::begin_subroutine, .number = static_cast<int>(s)});
      put_all();
      out_.operations.push_back({.op = Op::end_subroutine});
    }
    remove_unused();
    return std::move(out_);
  }

 private:
  using Bits = std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>;
  static constexpr Bits sign = Bits(1) << (8 * sizeof(S) - 1);

  void begin(const Graph& graph) {
    graph_ = &graph;
    uses_ = trace::use_counts(graph);
    value_.assign(nodes().size(), -1);
  }

  void put_all() {
    find_nested();
    for (const Item& item : graph_->items()) {
      if (item.kind == Item::straight) compute(item);
      if (item.kind == Item::loop) loop(item);
      if (item.kind == Item::effect) item.subroutine >= 0 ? run_subroutine(item) : effect(item);
      if (item.kind == Item::begin_scope) begin_scope(item);
      if (item.kind == Item::end_scope) end_scope(graph_->items()[static_cast<std::size_t>(item.other_end)]);
    }
    out_.names.resize(out_.home.size());
    for (const auto& [id, name] : graph_->names())
      if (value_[id] >= 0) out_.names[static_cast<std::size_t>(value_[id])] = name;
  }

  // A node with a single use, in the same item, is computed where it is used.
  void find_nested() {
    std::vector<int> user(nodes().size(), -1), depth(nodes().size(), 0);
    nested_.assign(nodes().size(), false);
    for (Id id = 0; id < static_cast<Id>(nodes().size()); ++id)
      for (Id o : nodes()[id].operand)
        if (uses_[id] > 0 && o >= 0) user[o] = nodes()[id].item;
    for (Id id = 0; id < static_cast<Id>(nodes().size()); ++id) {
      for (Id o : nodes()[id].operand)
        if (o >= 0 && nested_[o]) depth[id] = std::max(depth[id], depth[o] + 1);
      const bool angle = nodes()[id].op == trace::Op::sine || nodes()[id].op == trace::Op::cosine;
      nested_[id] = uses_[id] == 1 && !angle && depth[id] < deepest && user[id] == nodes()[id].item;
    }
  }

  // Inputs are numbers of the memory as it is here, even if they are used later.
  void compute(const Item& item) {
    for (Id id : item.nodes)
      if (uses_[id] > 0 && (!nested_[id] || nodes()[id].op == trace::Op::input)) value(id);
  }

  std::vector<std::size_t> used_variables(const Item& item) const {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      if (uses_[item.variable[i]] > 0) used.push_back(i);
    return used;
  }

  void loop(const Item& item) {
    if (used_variables(item).empty()) return;
    begin_variables(item);
    out_.operations.push_back({.op = Op::begin_loop, .number = item.times});
    compute(item);
    assign_variables(item);
    out_.operations.push_back({.op = Op::end_loop});
  }

  void begin_scope(const Item& item) {
    if (used_variables(item).empty()) return;
    const Value condition = value(item.condition);
    begin_variables(item);
    outer_turns_.push_back(turn_begins_);
    if (item.again >= 0) turn_begins_ = ++time_;
    out_.operations.push_back({.op = item.unless ? Op::begin_unless : Op::begin_scope,
                               .from = {condition, -1, -1},
                               .number = item.again < 0 ? 1 : item.times,
                               .time = time_});
  }

  void end_scope(const Item& item) {
    if (used_variables(item).empty()) return;
    Value again = item.again < 0 || item.times < 2 ? -1 : value(item.again);
    if (again >= 0 && nodes()[item.again].op == trace::Op::variable)
      again = put(Op::copy, again);  // it may change first
    assign_variables(item);
    turn_begins_ = outer_turns_.back();
    outer_turns_.pop_back();
    out_.operations.push_back({.op = Op::end_scope, .from = {again, -1, -1}});
  }

  void begin_variables(const Item& item) {
    for (std::size_t i : used_variables(item)) value_[item.variable[i]] = put(Op::copy, value(item.start[i]));
  }

  void assign_variables(const Item& item) {
    const std::vector<std::size_t> used = used_variables(item);
    std::map<std::size_t, Value> next;
    for (std::size_t i : used) {
      next[i] = value(item.next[i]);
      const bool another = nodes()[item.next[i]].op == trace::Op::variable && item.next[i] != item.variable[i];
      if (another) next[i] = put(Op::copy, next[i]);  // it may change first
    }
    for (std::size_t i : used)
      if (next[i] != value_[item.variable[i]])
        out_.operations.push_back({.op = Op::assign, .to = value_[item.variable[i]], .from = {next[i], -1, -1}});
  }

  void effect(const Item& item) {
    StageCall call;
    call.stage = item.call;
    for (const trace::Write& store : item.stores) call.writes.push_back({memory(store.place), value(store.value)});
    if (item.condition < 0) {
      for (const StageCall::Write& write : call.writes)
        out_.operations.push_back({.op = Op::store, .from = {write.value, -1, -1}, .at = write.at, .time = time_});
      ++time_;
      if (item.call == Call::none) return;
      call.writes.clear();
    }
    Operation operation{.op = item.condition < 0 ? Op::call : Op::call_if,
                        .number = static_cast<int>(out_.calls.size()),
                        .time = time_};
    if (item.condition >= 0) operation.from[0] = value(item.condition);
    for (std::size_t i = 0; i < item.variable.size(); ++i) {
      const Value before = value(item.start[i]);
      value_[item.variable[i]] = new_value({});
      call.variables.push_back({memory(item.place[i]), before, value_[item.variable[i]]});
    }
    out_.operations.push_back(operation);
    out_.calls.push_back(std::move(call));
    ++time_;
  }

  // What a subroutine has left where it reads an argument need not be stored there again.
  void run_subroutine(const Item& item) {
    const std::vector<std::size_t> used = used_variables(item);
    if (used.empty()) return;
    std::vector<Operation> stores;
    for (const trace::Write& argument : item.stores) {
      const Memory at = memory(argument.place);
      const Value v = value(argument.value);
      if (out_.home[v] == at && out_.born[v] >= std::max(handed_changed_[at.offset], turn_begins_)) continue;
      stores.push_back({.op = Op::store, .from = {v, -1, -1}, .at = at, .time = time_});
    }
    out_.operations.insert(out_.operations.end(), stores.begin(), stores.end());
    for (const Operation& store : stores) handed_changed_[store.at.offset] = time_ + 1;
    SubroutineRun run;
    run.subroutine = item.subroutine;
    out_.operations.push_back({.op = Op::run, .number = static_cast<int>(out_.runs.size()), .time = ++time_});
    ++time_;
    add_changes(item.subroutine, run);
    for (const Memory& at : run.changes) handed_changed_[at.offset] = time_;
    for (std::size_t i : used) run.results.push_back(value_[item.variable[i]] = new_value(memory(item.place[i])));
    out_.runs.push_back(std::move(run));
  }

  // What a subroutine hands back, and what it hands to others.
  void add_changes(int subroutine, SubroutineRun& run) {
    const auto add = [&](const std::vector<trace::Write>& writes) {
      for (const trace::Write& write : writes) run.changes.push_back(memory(write.place));
    };
    add(subroutines_[subroutine]->items().back().stores);
    for (const Item& item : subroutines_[subroutine]->items()) {
      run.calls = run.calls || item.call != Call::none;
      if (item.subroutine >= 0) add(item.stores), add_changes(item.subroutine, run);
    }
  }

  Value new_value(Memory home, bool fixed = false) {
    out_.home.push_back(home);
    out_.fixed.push_back(fixed);
    out_.born.push_back(time_);
    return static_cast<Value>(out_.home.size()) - 1;
  }

  Value put(Op op, Value a, Value b = -1, Value c = -1) {
    out_.operations.push_back({.op = op, .to = new_value({}), .from = {a, b, c}});
    return out_.operations.back().to;
  }
  Value shifted(Value a, int bits) {
    const Value result = put(Op::shift_left, a);
    out_.operations.back().number = bits;
    return result;
  }

  Value constant(Bits bits) {
    const auto [known, is_new] = constant_.try_emplace(bits, -1);
    if (is_new) {
      const int offset = static_cast<int>(out_.constants.size()) * machine_.constant_bytes();
      known->second = new_value({Memory::constants, offset}, true);
      out_.constants.push_back(bits);
    }
    return known->second;
  }
  Value number(S value) { return constant(std::bit_cast<Bits>(value)); }

  Memory memory(const Place& place) {
    if (place.array >= Access::first_row) {
      const auto [known, is_new] = row_.try_emplace({place.array, place.number}, static_cast<int>(out_.rows.size()));
      if (is_new) out_.rows.push_back({0, place.array, place.number});
      return {Memory::slots, (known->second + 1) * machine_.register_bytes};
    }
    if (place.array == Access::handed) {
      const auto [known, is_new] = handed_number_.try_emplace(place.number, out_.handed);
      if (is_new) ++out_.handed;
      return {Memory::handed, known->second * machine_.register_bytes};
    }
    if (place.array == Access::failed) return {Memory::slots, 0};
    if (place.array == Access::own && place.number >= TilePlaces::most_own)
      throw std::length_error("a tile has too many numbers outside its arrays for machine code");
    if (place.array == Access::own) return {Memory::tile, static_cast<int>(places_.own[place.number])};
    if (place.array < 0 || place.array >= places_.arrays) throw std::logic_error("a number of a step has no place");
    const std::ptrdiff_t offset =
        places_.first[place.array] + static_cast<std::ptrdiff_t>(place.number) * machine_.register_bytes;
    if (offset > std::numeric_limits<int>::max()) throw std::length_error("a tile is too large for machine code");
    return {Memory::block, static_cast<int>(offset)};
  }

  Value value(Id id) {
    if (value_[id] >= 0) return value_[id];
    const Node& node = nodes()[id];
    const auto from = [&](int i) { return value(node.operand[i]); };
    switch (node.op) {
      case trace::Op::constant: return value_[id] = number(static_cast<S>(node.value));
      case trace::Op::input: return value_[id] = new_value(memory(node.place), node.place.lasting && !node.place.turns);
      case trace::Op::variable: return value(node.operand[0]);  // of a loop, behind it
      case trace::Op::by_precision:
        return value_[id] = number(static_cast<S>(sizeof(S) == 4 ? node.single : node.value));
      case trace::Op::none: return value_[id] = constant(0);
      case trace::Op::invert: return value_[id] = put(Op::differ, from(0), constant(~Bits(0)));
      case trace::Op::negate: return value_[id] = put(Op::differ, from(0), constant(sign));
      case trace::Op::sine:
      case trace::Op::cosine: return turn(node), value_[id];
      case trace::Op::sqrt: return value_[id] = put(Op::sqrt, from(0));
      case trace::Op::beyond: {
        const Value bound = from(1);
        return value_[id] = put(Op::greater, magnitude(from(0)), bound);
      }
      case trace::Op::farther: {
        const Value most = from(0), own = magnitude(from(1));
        if (machine_.has_larger()) return value_[id] = put(Op::larger, own, most);
        return value_[id] = put(Op::select, put(Op::greater, own, most), own, most);
      }
      case trace::Op::fma: {
        const Node& added = nodes()[node.operand[2]];
        const bool subtracts = added.op == trace::Op::negate && value_[node.operand[2]] < 0;
        const Value a = from(0), b = from(1), c = subtracts ? value(added.operand[0]) : from(2);
        return value_[id] = put(subtracts ? Op::fms : Op::fma, a, b, c);
      }
      default: break;
    }
    const Op op = op_of(node.op);
    const Value a = from(0), b = from(1), c = operands(op) > 2 ? from(2) : -1;
    return value_[id] = put(op, a, b, c);
  }

  static Op op_of(trace::Op op) {
    switch (op) {
      case trace::Op::add: return Op::add;
      case trace::Op::subtract: return Op::subtract;
      case trace::Op::multiply: return Op::multiply;
      case trace::Op::divide: return Op::divide;
      case trace::Op::fnma: return Op::fnma;
      case trace::Op::less: return Op::less;
      case trace::Op::either: return Op::either;
      case trace::Op::both: return Op::both;
      case trace::Op::select: return Op::select;
      default: throw std::logic_error("an operation of a graph has no machine operation");
    }
  }

  Value magnitude(Value a) { return put(Op::both, a, constant(~sign)); }

  // Sine and cosine of an angle, as in simd/sincos.h: for all nodes of the item that turn by it.
  void turn(const Node& one) {
    using C = simd::SincosConstants<S>;
    const Id angle = one.operand[0];
    const Value x = value(angle);
    const Value quadrant = put(Op::fma, x, number(S(0.636619772367581343)), number(C::round));
    const Value turns = put(Op::subtract, quadrant, number(C::round));
    Value r = x;
    for (int i = 0; i < 3; ++i) r = put(Op::fnma, number(C::half_pi[i]), turns, r);
    const Value z = put(Op::multiply, r, r);
    Value s = number(C::sine[0]), c = number(C::cosine[0]);
    for (int i = 1; i < C::terms; ++i) {
      s = put(Op::fma, s, z, number(C::sine[i]));
      c = put(Op::fma, c, z, number(C::cosine[i]));
    }
    s = put(Op::fma, put(Op::multiply, s, z), r, r);
    const Value rest = put(Op::fnma, number(S(0.5)), z, number(S(1)));
    c = put(Op::fma, put(Op::multiply, z, z), c, rest);
    constexpr int top = 8 * sizeof(S) - 1;
    const Value odd = shifted(quadrant, top);
    const Value sine_sign = put(Op::both, shifted(quadrant, top - 1), constant(sign));
    const Value swap = machine_.avx512() ? put(Op::spread_sign, odd) : odd;  // AVX2 selects by the top bit
    const Value sine = put(Op::differ, put(Op::select, swap, c, s), sine_sign);
    const Value swapped = put(Op::select, swap, s, c);
    const Value cosine = machine_.avx512() ? put(Op::differ3, swapped, odd, sine_sign)
                                           : put(Op::differ, put(Op::differ, swapped, odd), sine_sign);
    for (Id id : graph_->items()[static_cast<std::size_t>(one.item)].nodes) {
      if (nodes()[id].operand[0] != angle) continue;
      if (nodes()[id].op == trace::Op::sine) value_[id] = sine;
      if (nodes()[id].op == trace::Op::cosine) value_[id] = cosine;
    }
  }

  void remove_unused() {
    std::vector<char> used(out_.home.size(), false);
    std::vector<Operation> kept;
    for (auto o = out_.operations.rbegin(); o != out_.operations.rend(); ++o) {
      if (has_result(o->op) && !used[o->to]) continue;
      for (Value v : o->from)
        if (v >= 0) used[v] = true;
      if (o->op == Op::assign) used[o->to] = true;
      if (o->op == Op::call || o->op == Op::call_if) {
        for (const StageCall::Write& write : out_.calls[o->number].writes) used[write.value] = true;
        for (const StageCall::Variable& variable : out_.calls[o->number].variables) used[variable.before] = true;
      }
      kept.push_back(*o);
    }
    std::reverse(kept.begin(), kept.end());
    out_.operations = std::move(kept);
  }

  const std::vector<Node>& nodes() const { return graph_->nodes(); }

  const Graph* graph_ = nullptr;  // of the step, or of a subroutine
  const TilePlaces& places_;
  const Machine& machine_;
  const std::vector<std::shared_ptr<Graph>>& subroutines_;
  std::vector<int> uses_;
  std::vector<Value> value_;  // by node
  std::vector<char> nested_;
  std::map<Bits, Value> constant_;
  std::map<std::pair<int, int>, int> row_;
  std::map<int, int> handed_number_;   // by number of the tile
  std::map<int, int> handed_changed_;  // by offset: the time of the last change
  int time_ = 0;
  int turn_begins_ = 0;  // the time at which the turn of the innermost scope that is repeated has begun
  std::vector<int> outer_turns_;
  Listing out_;
};

}  // namespace

Listing lower(const Graph& graph, const TilePlaces& places, const Machine& machine, const std::vector<Access>& rows) {
  if (machine.scalar_bytes == 4) return Lowering<float>(graph, places, machine, rows).run();
  return Lowering<double>(graph, places, machine, rows).run();
}

}  // namespace lockstep::jit
