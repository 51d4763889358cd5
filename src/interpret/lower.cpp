#include "lower.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <stdexcept>

#include "draft.h"
#include "lockstep/error.h"
#include "trace/liveness.h"
#include "trace/trace.h"

namespace lockstep::interpret {

using trace::use_counts;

namespace {

// What an operation of the graph is in a list, and with a constant for its first operand.
struct Listing {
  Op op;
  Opcode opcode;
  std::optional<Opcode> of_constant = {};
};
constexpr Listing listings[] = {
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

const Listing& listing_of(Op op) {
  for (const Listing& listing : listings)
    if (listing.op == op) return listing;
  throw std::logic_error("an operation that no list knows");
}

// Longer lists, of many sweeps over many rows, are far slower than the stages' loops, and long in the making.
constexpr std::size_t longest = 40000;

// Goes through the graph in the order of recording, loops turn by turn.
class Lowering {
 public:
  explicit Lowering(const Graph& graph)
      : graph_(graph), nodes_(graph.nodes()), uses_(use_counts(graph)), value_(nodes_.size(), -1) {
    for (const Item& item : graph.items()) calls_ = calls_ || (item.call != Call::none && item.condition < 0);
    find_last_uses();
  }

  // False where code is called that a list has no name for, or where it would be too long.
  bool run() {
    for (const Item& item : graph_.items())  // the state, of which a step may not look at everything
      if (!calls_ && item.kind == Item::effect && item.condition < 0)
        for (const Write& store : item.stores) kept(store.place);
    for (const Item& item : graph_.items()) {
      if (item.kind == Item::straight) lower_nodes(item);
      if (operations_.size() + static_cast<std::size_t>(item.times) * item.nodes.size() > longest) return false;
      if (item.kind == Item::loop) lower_loop(item);
      if (item.kind == Item::effect && !lower_effect(item)) return false;
    }
    return operations_.size() <= longest;
  }

  OperationList finish(TableStorage& storage, bool apart) {
    drop_unused();
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

  Value fresh() { return values_++; }

  int constant_index(double value) {
    const auto [known, is_new] = constant_at_.try_emplace(value, static_cast<int>(constants_.size()));
    if (is_new) constants_.push_back(value);
    return known->second;
  }

  // The value that stands for a node now.
  Value value(Id id) {
    const Node& n = node(id);
    if (n.op == Op::constant) return filled(n.value);
    if (n.op == Op::none) return filled(0.0);
    if (n.op == Op::rounding) {
      if (rounding_ < 0) rounding_ = once({.opcode = Opcode::fill_rounding, .constant = constant_index(0.0)});
      return rounding_;
    }
    if (n.op == Op::variable && n.operand[0] >= 0) return value_[n.operand[0]];
    return value_[id];
  }

  Value once(DraftOp draft) {
    draft.to = fresh();
    constants_first_.push_back(draft);
    return draft.to;
  }
  Value filled(double number) {
    const auto [known, is_new] = filled_.try_emplace(number, -1);
    if (is_new) known->second = once({.opcode = Opcode::fill, .constant = constant_index(number)});
    return known->second;
  }

  void lower_nodes(const Item& item) {
    for (Id id : item.nodes)
      if (uses_[id] > 0) lower_node(id, item);
  }

  void lower_loop(const Item& item) {
    const auto wanted = [&](std::size_t i) { return uses_[item.variable[i]] > 0; };
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      if (wanted(i)) value_[item.variable[i]] = value(item.start[i]);
    for (int turn = 0; turn < item.times; ++turn) {
      lower_nodes(item);
      std::vector<Value> next;
      for (std::size_t i = 0; i < item.variable.size(); ++i) next.push_back(wanted(i) ? value(item.next[i]) : -1);
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

  // What the next step starts from goes from slot to slot, unless a call looks for it in memory.
  // Not where one state becomes another's, which may have been overwritten by then.
  bool keep_state(const std::vector<MemoryAccess>& written) {
    for (const MemoryAccess& access : written) {
      if (lasting_.contains(access.value)) return false;
      const Value state = kept(access.place);
      operations_.push_back({.opcode = Opcode::copy, .to = state, .from = {access.value}});
      after_.push_back({access.place, state});
    }
    return true;
  }

  // A number that lasts for a call, read before its first step.
  Value kept(const Place& place) {
    const auto [known, is_new] = kept_.try_emplace(place.text, -1);
    if (is_new) {
      known->second = fresh();
      before_.push_back({place, known->second});
      lasting_.insert(known->second);
      if (!place.lasting) state_.push_back(before_.back());
    }
    return known->second;
  }

  bool is_negation(Id id) const { return node(id).op == Op::negate; }

  // The last item that wants each node, or its negative, which may be taken from the node itself.
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

  // What it changes it changes in place: values that nobody else has and nobody wants later.
  void lower_call_if(const Item& item, const std::vector<MemoryAccess>& writes) {
    const int here = static_cast<int>(&item - graph_.items().data());
    DraftOp draft{.opcode = Opcode::call_if, .from = {value(item.condition)}, .call = item.call};
    std::map<Value, int> times;
    for (Id start : item.start) ++times[value(start)];
    for (std::size_t i = 0; i < item.variable.size(); ++i) {
      const Value start = value(item.start[i]);
      const bool own = times[start] == 1 && !lasting_.contains(start) && !is_constant(item.start[i]) &&
                       node(item.start[i]).op != Op::variable && last_use_[item.start[i]] <= here;
      const Value held = own ? start : fresh();
      if (!own) operations_.push_back({.opcode = Opcode::copy, .to = held, .from = {start}});
      value_[item.variable[i]] = held;
      draft.reads.push_back({item.place[i], held});
    }
    draft.writes = state_;  // as the step began
    draft.writes.insert(draft.writes.end(), writes.begin(), writes.end());
    draft.writes.insert(draft.writes.end(), draft.reads.begin(), draft.reads.end());
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
    const Listing& listing = listing_of(n.op);
    DraftOp draft{.opcode = listing.opcode, .to = value_[id] = fresh()};
    std::array<Id, 3> from = n.operand;
    if (n.op == Op::beyond || (commutes(listing.opcode) && is_constant(from[1]))) std::swap(from[0], from[1]);
    if (listing.of_constant && is_constant(from[0]) && !is_constant(from[1])) {
      draft.opcode = *listing.of_constant;
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
      value_[id] = kept(place);
      return;
    }
    value_[id] = fresh();
    operations_.push_back({.opcode = Opcode::read, .to = value_[id], .reads = {{place, value_[id]}}});
  }

  // The first of the two that is wanted makes both.
  void lower_angle(Id id, const Item& item) {
    const Id angle = node(id).operand[0];
    const auto of_angle = [&](Id other) {
      const Op op = node(other).op;
      return (op == Op::sine || op == Op::cosine) && node(other).operand[0] == angle && uses_[other] > 0;
    };
    if (*std::find_if(item.nodes.begin(), item.nodes.end(), of_angle) != id) return;
    DraftOp draft{.opcode = Opcode::sincos, .to = fresh(), .also_to = fresh(), .from = {value(angle)}};
    for (Id other : item.nodes)
      if (of_angle(other)) value_[other] = node(other).op == Op::sine ? draft.to : draft.also_to;
    operations_.push_back(std::move(draft));
  }

  void drop_unused();

  const Graph& graph_;
  const std::vector<Node>& nodes_;
  std::vector<int> uses_, last_use_;
  std::vector<Value> value_;  // by node
  int values_ = 0;
  Value rounding_ = -1;
  std::vector<double> constants_;
  std::map<double, int> constant_at_;
  std::map<double, Value> filled_;
  bool calls_ = false;
  std::map<std::string, Value> kept_;  // by place
  std::set<Value> lasting_;            // their values
  std::vector<MemoryAccess> state_;    // those of them that a step changes
  std::vector<DraftOp> constants_first_, operations_;
  std::vector<MemoryAccess> before_, after_;
};

// Negations that have become part of others.
void Lowering::drop_unused() {
  std::vector<char> used(static_cast<std::size_t>(values_), false);
  for (const DraftOp& draft : operations_) each_use(draft, [&](Value v) { used[v] = true; });
  std::erase_if(operations_, [&](const DraftOp& draft) { return draft.opcode == Opcode::negate && !used[draft.to]; });
}

// In the tile, which stages that are called look for there.
bool has_numbers_per_environment(const Program& program) {
  const auto& declared = program.settings.per_environment;
  return declared.contains(Parameter::gear_ratio) || declared.contains(Parameter::offset) ||
         declared.contains(Parameter::mass);
}

}  // namespace

const OperationList* interpreted_step(const Program& program) {
  const InterpretedStep& step = program.interpreted.get([&] {
    const auto made = std::make_shared<InterpretedStep>();
    try {
      const auto list = [&](const Graph& graph) {
        Lowering lowering(graph);
        if (!lowering.run()) return OperationList{};
        return lowering.finish(made->storage, has_numbers_per_environment(program));
      };
      const trace::TracedStep traced = trace::trace_step(program);
      made->any = list(traced.any);
      if (traced.consistent) made->consistent = list(*traced.consistent);
      if (made->consistent.step.count > 0) made->any.consistent = &made->consistent;
    } catch (const SettingsError&) {      // lane by lane
    } catch (const std::length_error&) {  // by far
      made->any = {};
    }
    return std::shared_ptr<const InterpretedStep>(made);
  });
  return step.any.step.count > 0 ? &step.any : nullptr;
}

bool interpreter_pays(const Program& program) {
  constexpr int most_velocities = 30;  // that are solved for; measured: docs/kernels.md
  const Tables<double>& t = program.f64;
  return t.solver.n <= most_velocities && program.second_phase_anyway && !t.bounds.always;
}

}  // namespace lockstep::interpret
