// Lowers a graph to a list of operations. SPDX-License-Identifier: Apache-2.0
#include "lower.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "draft.h"
#include "lockstep/error.h"
#include "trace/cost.h"
#include "trace/liveness.h"
#include "trace/trace.h"

namespace lockstep::interpret {

using trace::use_counts;

namespace {

// The opcode of a graph's operation, and its opcode if the first operand is a constant.
struct OpcodeRule {
  Op op;
  Opcode opcode;
  std::optional<Opcode> of_constant = {};
};
constexpr OpcodeRule opcode_rules[] = {
    {Op::negate, Opcode::negate},
    {Op::add, Opcode::add, Opcode::add_constant},
    {Op::subtract, Opcode::subtract, Opcode::subtract_from_constant},
    {Op::multiply, Opcode::multiply, Opcode::multiply_constant},
    {Op::divide, Opcode::divide},
    {Op::fma, Opcode::fma, Opcode::fma_constant},
    {Op::fnma, Opcode::fnma, Opcode::fnma_constant},
    {Op::sqrt, Opcode::sqrt},
    {Op::farther, Opcode::farther},
    {Op::less, Opcode::less},
    {Op::beyond, Opcode::beyond, Opcode::beyond_constant},  // the bound comes first
    {Op::either, Opcode::either},
    {Op::both, Opcode::both},
    {Op::invert, Opcode::invert},
    {Op::select, Opcode::select},
};

const OpcodeRule& rule_of(Op op) {
  for (const OpcodeRule& rule : opcode_rules)
    if (rule.op == op) return rule;
  throw std::logic_error("an operation of a graph has no opcode");
}

// Longer lists, of many sweeps over many rows, are much slower than the tables' loops, and take long to make.
constexpr std::size_t longest = 40000;
constexpr const char* too_long = "a step takes more operations than the interpreter is made for";

// Lowers the items in order. Loops are unrolled.
class Lowering {
 public:
  explicit Lowering(const Graph& graph)
      : graph_(graph), nodes_(graph.nodes()), uses_(use_counts(graph)), value_(nodes_.size(), -1) {
    for (const Item& item : graph.items()) calls_ = calls_ || (item.call != Call::none && item.condition < 0);
    find_last_uses();
  }

  // Why the graph has no list: it has code that is not a Call, or the list would be too long. Empty if it has one.
  std::string run() {
    for (const Item& item : graph_.items())  // all of the state, even numbers that a step does not read
      if (!calls_ && item.kind == Item::effect && item.condition < 0)
        for (const Write& store : item.stores) lasting_value(store.place);
    for (const Item& item : graph_.items()) {
      if (item.kind == Item::straight) lower_nodes(item);
      if (operations_.size() + static_cast<std::size_t>(item.times) * item.nodes.size() > longest) return too_long;
      if (item.kind == Item::loop) lower_loop(item);
      if (item.kind == Item::effect && !lower_effect(item)) return "a step has a loop that only the tables run";
    }
    return operations_.size() <= longest ? "" : too_long;
  }

  OperationList finish(TableStorage& storage, bool apart) {
    remove_unused_negations();
    return allocate_slots({.constants_first = std::move(constants_first_),
                           .before = std::move(before_),
                           .operations = schedule(std::move(operations_), values_, lasting_),
                           .after = std::move(after_),
                           .constants = std::move(constants_),
                           .values = values_,
                           .apart = apart || calls_},
                          storage);
  }

 private:
  const Node& node(Id id) const { return nodes_[id]; }
  bool is_constant(Id id) const { return node(id).op == Op::constant; }

  Value new_value() { return values_++; }

  int constant_index(double value) {
    const auto [known, is_new] = index_of_constant_.try_emplace(value, static_cast<int>(constants_.size()));
    if (is_new) constants_.push_back(value);
    return known->second;
  }

  // The present value of a node. That of a loop's variable changes from turn to turn.
  Value value(Id id) {
    const Node& n = node(id);
    if (n.op == Op::constant) return constant_value(n.value);
    if (n.op == Op::none) return constant_value(0.0);
    if (n.op == Op::rounding) {
      if (rounding_ < 0) rounding_ = made_first({.opcode = Opcode::fill_rounding, .constant = constant_index(0.0)});
      return rounding_;
    }
    if (n.op == Op::variable && n.operand[0] >= 0) return value_[n.operand[0]];
    return value_[id];
  }

  // The result of an operation that runs once, before the first step.
  Value made_first(DraftOp draft) {
    draft.to = new_value();
    constants_first_.push_back(draft);
    return draft.to;
  }
  Value constant_value(double number) {
    const auto [known, is_new] = value_of_constant_.try_emplace(number, -1);
    if (is_new) known->second = made_first({.opcode = Opcode::fill, .constant = constant_index(number)});
    return known->second;
  }

  void lower_nodes(const Item& item) {
    for (Id id : item.nodes)
      if (uses_[id] > 0) lower_node(id, item);
  }

  void lower_loop(const Item& item) {
    const auto used = [&](std::size_t i) { return uses_[item.variable[i]] > 0; };
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      if (used(i)) value_[item.variable[i]] = value(item.start[i]);
    for (int turn = 0; turn < item.times; ++turn) {
      lower_nodes(item);
      std::vector<Value> next;
      for (std::size_t i = 0; i < item.variable.size(); ++i) next.push_back(used(i) ? value(item.next[i]) : -1);
      for (std::size_t i = 0; i < item.variable.size(); ++i) value_[item.variable[i]] = next[i];
    }
  }

  bool lower_effect(const Item& item) {
    const auto writes = [&] {
      std::vector<MemoryAccess> all;
      for (const Write& store : item.stores) all.push_back({store.place, value(store.value)});
      return all;
    };
    if (item.condition >= 0) {
      lower_call_if(item, writes());
      return true;
    }
    if (!item.code.empty() && item.call == Call::none) return false;
    const std::vector<MemoryAccess> written = writes();
    if (!calls_) return keep_state(written);
    for (const MemoryAccess& access : written) operations_.push_back({.opcode = Opcode::write, .writes = {access}});
    if (item.call != Call::none) operations_.push_back({.opcode = Opcode::call, .call = item.call});
    return true;
  }

  // Without calls the state stays in slots from step to step. False if one number of the state is to become another: it
  // may have been overwritten by then.
  bool keep_state(const std::vector<MemoryAccess>& written) {
    for (const MemoryAccess& access : written) {
      if (lasting_.contains(access.value)) return false;
      const Value state = lasting_value(access.place);
      operations_.push_back({.opcode = Opcode::copy, .to = state, .from = {access.value}});
      after_.push_back({access.place, state});
    }
    return true;
  }

  // A number that is read before the first step and has a slot of its own in all steps.
  Value lasting_value(const Place& place) {
    const auto [known, is_new] = value_at_place_.try_emplace(place.text, -1);
    if (is_new) {
      known->second = new_value();
      before_.push_back({place, known->second});
      lasting_.insert(known->second);
      if (!place.lasting) state_.push_back(before_.back());
    }
    return known->second;
  }

  bool is_negation(Id id) const { return node(id).op == Op::negate; }

  // The last item that uses each node, or its negative, which may become part of another operation.
  void find_last_uses() {
    last_use_.assign(nodes_.size(), -1);
    for (int i = 0; i < static_cast<int>(graph_.items().size()); ++i) {
      const Item& item = graph_.items()[i];
      for (Id id : item.nodes)
        for (Id operand : node(id).operand)
          for (Id o = operand; o >= 0 && uses_[id] > 0; o = is_negation(o) ? node(o).operand[0] : -1) last_use_[o] = i;
      for (const std::vector<Id>* ids : {&item.start, &item.next})
        for (Id id : *ids) last_use_[id] = i;
      for (const Write& store : item.stores) last_use_[store.value] = i;
    }
  }

  // The call changes its variables' values in their slots. Values with other or later uses are copied first.
  void lower_call_if(const Item& item, const std::vector<MemoryAccess>& writes) {
    const int here = static_cast<int>(&item - graph_.items().data());
    DraftOp draft{.opcode = Opcode::call_if, .from = {value(item.condition)}, .call = item.call};
    std::map<Value, int> count;
    for (Id start : item.start) ++count[value(start)];
    for (std::size_t i = 0; i < item.variable.size(); ++i) {
      const Value start = value(item.start[i]);
      const bool exclusive = count[start] == 1 && !lasting_.contains(start) && !is_constant(item.start[i]) &&
                             node(item.start[i]).op != Op::variable && node(item.start[i]).op != Op::none &&
                             last_use_[item.start[i]] <= here;
      const Value changed = exclusive ? start : new_value();
      if (!exclusive) operations_.push_back({.opcode = Opcode::copy, .to = changed, .from = {start}});
      value_[item.variable[i]] = changed;
      draft.reads.push_back({item.place[i], changed});
    }
    draft.writes = state_;  // as at the start of the step
    draft.writes.insert(draft.writes.end(), writes.begin(), writes.end());
    draft.writes.insert(draft.writes.end(), draft.reads.begin(), draft.reads.end());
    if (item.call == Call::hold)  // it may change these in the tile's own memory
      for (const MemoryAccess& access : before_)
        if (access.place.turns) draft.reads.push_back(access);
    operations_.push_back(std::move(draft));
  }

  void lower_node(Id id, const Item& item) {
    const Node& n = node(id);
    switch (n.op) {
      case Op::input: return lower_input(id);
      case Op::sine:
      case Op::cosine: return lower_angle(id, item);
      case Op::none:
      case Op::rounding:
      case Op::constant:
      case Op::variable: return;
      default: break;
    }
    const OpcodeRule& rule = rule_of(n.op);
    DraftOp draft{.opcode = rule.opcode, .to = value_[id] = new_value()};
    std::array<Id, 3> from = n.operand;
    if (n.op == Op::beyond || (commutes(rule.opcode) && is_constant(from[1]))) std::swap(from[0], from[1]);
    if (rule.of_constant && is_constant(from[0]) && !is_constant(from[1])) {
      draft.opcode = *rule.of_constant;
      draft.constant = constant_index(node(from[0]).value);
      from[0] = -1;
    } else if (n.op == Op::fma && is_negation(from[2])) {
      draft.opcode = Opcode::fms;
      from[2] = node(from[2]).operand[0];
    }
    for (int i = 0; i < 3; ++i)
      if (from[i] >= 0) draft.from[i] = value(from[i]);
    operations_.push_back(std::move(draft));
  }

  void lower_input(Id id) {
    const Place& place = node(id).place;
    if (place.lasting || !calls_) {
      value_[id] = lasting_value(place);
      return;
    }
    value_[id] = new_value();
    operations_.push_back({.opcode = Opcode::read, .to = value_[id], .reads = {{place, value_[id]}}});
  }

  // The first of sine and cosine that is used lowers both.
  void lower_angle(Id id, const Item& item) {
    const Id angle = node(id).operand[0];
    const auto of_angle = [&](Id other) {
      const Op op = node(other).op;
      return (op == Op::sine || op == Op::cosine) && node(other).operand[0] == angle && uses_[other] > 0;
    };
    if (*std::find_if(item.nodes.begin(), item.nodes.end(), of_angle) != id) return;
    DraftOp draft{.opcode = Opcode::sincos, .to = new_value(), .also_to = new_value(), .from = {value(angle)}};
    for (Id other : item.nodes)
      if (of_angle(other)) value_[other] = node(other).op == Op::sine ? draft.to : draft.also_to;
    operations_.push_back(std::move(draft));
  }

  void remove_unused_negations();

  const Graph& graph_;
  const std::vector<Node>& nodes_;
  std::vector<int> uses_, last_use_;
  std::vector<Value> value_;  // by node
  int values_ = 0;
  Value rounding_ = -1;
  std::vector<double> constants_;
  std::map<double, int> index_of_constant_;
  std::map<double, Value> value_of_constant_;
  bool calls_ = false;
  std::map<std::string, Value> value_at_place_;  // by place
  std::set<Value> lasting_;                      // the values in value_at_place_
  std::vector<MemoryAccess> state_;              // those that a step changes
  std::vector<DraftOp> constants_first_, operations_;
  std::vector<MemoryAccess> before_, after_;
};

// Negations that have become part of other operations.
void Lowering::remove_unused_negations() {
  std::vector<char> used(static_cast<std::size_t>(values_), false);
  for (const DraftOp& draft : operations_) each_use(draft, [&](Value v) { used[v] = true; });
  std::erase_if(operations_, [&](const DraftOp& draft) { return draft.opcode == Opcode::negate && !used[draft.to]; });
}

// Whether each tile has numbers of its own in memory, which called stages read. Where joints turn for ever, offsets are
// among them, but not in a step of consistent followers.
bool has_numbers_per_environment(const Program& program, bool consistent) {
  const auto& declared = program.settings.per_environment;
  return declared.contains(Parameter::gear_ratio) || declared.contains(Parameter::offset) ||
         program.f64.has_own_inertias() || (!consistent && program.f64.turning.count > 0);
}

const InterpretedStep& interpreted(const Program& program) {
  return program.interpreted.get([&] {
    const auto result = std::make_shared<InterpretedStep>();
    if (trace::cost_of(program).flops > trace::most_traced_flops) {
      result->obstacle = too_long;
      return std::shared_ptr<const InterpretedStep>(result);
    }
    try {
      const auto list = [&](const Graph& graph, bool consistent) {
        Lowering lowering(graph);
        if (const std::string obstacle = lowering.run(); !obstacle.empty()) {
          if (!consistent) result->obstacle = obstacle;
          return OperationList{};
        }
        return lowering.finish(result->storage, has_numbers_per_environment(program, consistent));
      };
      const trace::TracedStep traced = trace::trace_step(program);
      result->any = list(traced.any, false);
      if (traced.consistent) result->consistent = list(*traced.consistent, true);
      if (result->consistent.step.count > 0) result->any.consistent = &result->consistent;
    } catch (const SettingsError& error) {  // contacts, or a step that solves lane by lane
      result->obstacle = error.element() + " " + error.rule();
    } catch (const std::length_error&) {
      result->obstacle = too_long;
      result->any = {};
    }
    return std::shared_ptr<const InterpretedStep>(result);
  });
}

}  // namespace

const OperationList* interpreted_step(const Program& program) {
  const InterpretedStep& step = interpreted(program);
  return step.any.step.count > 0 ? &step.any : nullptr;
}

const std::string& list_obstacle(const Program& program) { return interpreted(program).obstacle; }

const char* speed_obstacle(const Program& program) {
  constexpr int most_velocities = 30;  // of the solver: see docs/kernels.md
  const Tables<double>& t = program.f64;
  if (t.solver.n > most_velocities) return "a step solves for more than 30 velocities";
  if (t.bounds.always) return "friction, kinematic drives or force limits call the tables in every step";
  if (!program.second_phase_anyway) return "where no bound acts, the tables leave out the velocity phase";
  if (t.rounds.used() && t.integrator == Integrator::leapfrog)  // limits act often
    return "leapfrog takes each step in which a bound acts again by the tables";
  return nullptr;
}

}  // namespace lockstep::interpret
