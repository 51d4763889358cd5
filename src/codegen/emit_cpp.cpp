// Emits a graph as C++ statements. SPDX-License-Identifier: Apache-2.0
#include "emit_cpp.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "simd/sincos.h"
#include "trace/liveness.h"

namespace lockstep::codegen {

using trace::use_counts;

namespace {

constexpr int sincos_operations = 20;
constexpr int deepest = 5;  // nesting of expressions, so that lines stay readable

// Emits the items in the order of the trace. Compilers mostly keep this order, in which values live shortly.
class Writer {
 public:
  explicit Writer(const Graph& graph)
      : graph_(graph),
        nodes_(graph.nodes()),
        uses_(use_counts(graph)),
        nested_(nodes_.size(), false),
        subtracted_(nodes_.size(), 0) {
    for (Id id = 0; id < static_cast<Id>(nodes_.size()); ++id)
      for (int i = 0; nodes_[id].op == Op::fnma && uses_[id] > 0 && i < 2; ++i) ++subtracted_[nodes_[id].operand[i]];
  }

  Emitted write() {
    find_nested();
    for (const Item& item : graph_.items()) {
      if (item.kind == Item::straight) lines(item, 0);
      if (item.kind == Item::loop) in_one_block([&] { loop(item); });
      if (item.kind == Item::effect) in_one_block([&] { effect(item); });
    }
    return std::move(out_);
  }

 private:
  // A node with a single use, in the same item, is written where it is used, unless the line would get too long.
  void find_nested() {
    std::vector<int> user(nodes_.size(), -1), depth(nodes_.size(), 0);  // by node: the item of its last user
    for (Id id = 0; id < static_cast<Id>(nodes_.size()); ++id)
      for (Id o : nodes_[id].operand)
        if (uses_[id] > 0 && o >= 0) user[o] = nodes_[id].item;
    for (Id id = 0; id < static_cast<Id>(nodes_.size()); ++id) {
      if (uses_[id] == 0) continue;
      const Node& node = nodes_[id];
      for (Id o : node.operand) depth[id] = std::max(depth[id], o >= 0 && nested_[o] ? depth[o] + 1 : 0);
      const bool named =
          node.op == Op::input || node.op == Op::variable || node.op == Op::sine || node.op == Op::cosine;
      const bool nameless = node.op == Op::constant || node.op == Op::none || node.op == Op::by_precision;
      nested_[id] =
          nameless || (!named && uses_[id] == 1 && depth[id] < deepest && (user[id] < 0 || user[id] == node.item));
    }
  }

  static std::string literal(double value) {
    if (std::isnan(value)) return "__builtin_nan(\"\")";
    return std::isinf(value) ? fmt::format("{}__builtin_inf()", value < 0 ? "-" : "") : fmt::format("{}", value);
  }
  static std::string number(double value) { return fmt::format("n({})", literal(value)); }

  std::string name(Id id) {
    if (nodes_[id].op == Op::variable && nodes_[id].operand[0] >= 0) id = nodes_[id].operand[0];
    if (const auto known = given_.find(id); known != given_.end()) return known->second;
    const auto traced = graph_.names().find(id);
    std::string base = traced != graph_.names().end() ? traced->second : "a", full = base;
    int& count = taken_[base];
    if (traced == graph_.names().end() || count > 0) full = fmt::format("{}_{}", base, count);
    ++count;
    return given_[id] = full;
  }

  const Item& home(Id id) const { return graph_.items()[std::max(0, nodes_[id].item)]; }
  std::string operand(Id id) { return operand(id, home(id)); }
  std::string operand(Id id, const Item& item) { return nested_[id] ? expression(id, item) : name(id); }

  void count(const Item& item, int flops) {
    ++out_.operations;
    out_.flops += static_cast<long>(flops) * (item.kind == Item::loop ? item.times : 1);
  }

  std::string expression(Id id, const Item& item) {
    const Node& node = nodes_[id];
    const auto arg = [&](int i) { return operand(node.operand[i], item); };  // in brackets, unless it is one word
    const auto bare_arg = [&](int i) { return bare(arg(i)); };               // between commas
    switch (node.op) {
      case Op::constant: return number(node.value);
      case Op::input: return node.place.text;
      case Op::by_precision: return fmt::format("T::by_precision({}, {})", literal(node.single), literal(node.value));
      case Op::none: return "T::none()";
      case Op::negate: return fmt::format("-{}", arg(0));
      case Op::add:
      case Op::subtract:
        return count(item, 1), fmt::format("({} {} {})", arg(0), node.op == Op::add ? '+' : '-', arg(1));
      case Op::multiply: return count(item, 1), fmt::format("({} * {})", arg(0), arg(1));
      case Op::divide: return count(item, 1), fmt::format("({} / {})", arg(0), arg(1));
      case Op::fma: return count(item, 2), fmt::format("fma({}, {}, {})", bare_arg(0), bare_arg(1), bare_arg(2));
      case Op::fnma: {  // compilers negate the first factor: they do it once for all products that share it
        const bool swaps =
            nodes_[node.operand[0]].op != Op::constant && subtracted_[node.operand[1]] < subtracted_[node.operand[0]];
        return count(item, 2), fmt::format("fnma({}, {}, {})", bare_arg(swaps), bare_arg(!swaps), bare_arg(2));
      }
      case Op::sqrt: return count(item, 1), fmt::format("sqrt({})", bare_arg(0));
      case Op::farther: return count(item, 0), fmt::format("farther({}, {})", bare_arg(0), bare_arg(1));
      case Op::less: return count(item, 0), fmt::format("less({}, {})", bare_arg(0), bare_arg(1));
      case Op::beyond: return count(item, 0), fmt::format("beyond({}, {})", bare_arg(0), bare_arg(1));
      case Op::either: return count(item, 0), fmt::format("({} | {})", arg(0), arg(1));
      case Op::both: return count(item, 0), fmt::format("({} & {})", arg(0), arg(1));
      case Op::invert: return count(item, 0), fmt::format("~{}", arg(0));
      case Op::select: return count(item, 0), fmt::format("select({}, {}, {})", bare_arg(0), bare_arg(1), bare_arg(2));
      default: return name(id);
    }
  }

  // Inputs are read right before their first use.
  void read_inputs(Id id, int indent) {
    if (nodes_[id].op == Op::input) return read_input(id, indent);
    for (Id o : nodes_[id].operand)
      if (o >= 0 && (nodes_[o].op == Op::input || nested_[o])) read_inputs(o, indent);
  }
  void read_input(Id id, int indent) {
    if (!defined_.insert(id).second) return;
    defines(indent, id);
    line(indent, fmt::format("const {} {} = {};", type(id), name(id), nodes_[id].place.text));
  }

  const char* type(Id id) const { return nodes_[id].mask ? "auto" : "T"; }

  void lines(const Item& item, int indent) {
    for (Id id : item.nodes) {
      const Node& node = nodes_[id];
      if (uses_[id] == 0 || nested_[id] || defined_.contains(id) || node.op == Op::input) continue;
      read_inputs(id, indent);
      if (node.op == Op::sine || node.op == Op::cosine) {
        indent == 0 ? in_one_block([&] { sine_and_cosine(id, item, indent); }) : sine_and_cosine(id, item, indent);
        continue;
      }
      defined_.insert(id);
      const std::string text = bare(expression(id, item));
      defines(indent, id);
      line(indent, fmt::format("const {} {} = {};", type(id), name(id), text));
    }
  }

  // Without outer brackets.
  static std::string bare(std::string text) {
    if (text.front() != '(') return text;
    int open = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
      open += text[i] == '(' ? 1 : text[i] == ')' ? -1 : 0;
      if (open == 0) return i + 1 == text.size() ? text.substr(1, text.size() - 2) : text;
    }
    return text;
  }

  void sine_and_cosine(Id id, const Item& item, int indent) {
    const Node& node = nodes_[id];
    if (turning_in_ != &item) {
      turning_in_ = &item;
      turning_.clear();
      for (Id candidate : item.nodes)
        if (nodes_[candidate].op == Op::sine || nodes_[candidate].op == Op::cosine)
          turning_[nodes_[candidate].operand[0]].push_back(candidate);
    }
    Id other = -1;
    for (Id candidate : turning_[node.operand[0]])
      if (candidate != id) other = candidate;
    const Id sine = node.op == Op::sine ? id : other, cosine = node.op == Op::sine ? other : id;
    defined_.insert(sine), defined_.insert(cosine);
    defines(indent, sine), defines(indent, cosine);
    line(indent, fmt::format("T {}, {};", name(sine), name(cosine)));
    line(indent, fmt::format("sincos({}, {}, {});", bare(operand(node.operand[0], item)), name(sine), name(cosine)));
    out_.operations += sincos_operations;
    out_.flops += simd::sincos_flops<float>;
  }

  void loop(const Item& item) {
    std::vector<std::size_t> used;
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      if (uses_[item.variable[i]] > 0) used.push_back(i);
    for (std::size_t i : used)
      if (nodes_[item.next[i]].op == Op::variable && item.next[i] != item.variable[i])
        throw std::logic_error("a loop assigns one variable to another, which the code would have overwritten");
    if (used.empty()) return;
    for (Id id : item.nodes)
      if (uses_[id] > 0) read_inputs(id, 0);
    for (std::size_t i : used) {
      read_inputs(item.start[i], 0);
      defines(0, item.variable[i]);
      line(0, fmt::format("T {} = {};", name(item.variable[i]), bare(operand(item.start[i], item))));
    }
    line(0, fmt::format("for (int i = 0; i < {}; ++i) {{", item.times));
    lines(item, 1);
    for (std::size_t i : used)
      line(1, fmt::format("{} = {};", name(item.variable[i]), bare(operand(item.next[i], item))));
    line(0, "}");
  }

  void effect(const Item& item) {
    const bool guarded = item.condition >= 0;
    const int indent = guarded ? 1 : 0;
    for (std::size_t i = 0; i < item.variable.size(); ++i) {
      read_inputs(item.start[i], 0);
      defines(0, item.variable[i]);
      line(0, fmt::format("{} {} = {};", type(item.variable[i]), name(item.variable[i]), bare(operand(item.start[i]))));
    }
    for (const Write& store : item.stores) read_inputs(store.value, 0);
    if (guarded) {
      read_inputs(item.condition, 0);
      line(0, fmt::format("if (any({})) {{", bare(operand(item.condition))));
    }
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      line(indent, fmt::format("{} = {};", item.place[i].text, name(item.variable[i])));
    for (const Write& store : item.stores)
      line(indent, fmt::format("{} = {};", store.place.text, bare(operand(store.value))));
    if (!item.code.empty()) line(indent, item.code);
    if (!guarded) return;
    for (std::size_t i = 0; i < item.variable.size(); ++i)
      line(1, fmt::format("{} = {};", name(item.variable[i]), item.place[i].text));
    line(0, "}");
  }

  // Adds a line. Lines within braces stay in one block, and so do those of in_one_block().
  void line(int indent, const std::string& text) {
    if (open_ == 0 && !(one_block_ && begun_)) out_.blocks.emplace_back();
    begun_ = true;
    Block& block = out_.blocks.back();
    block.code += std::string(2 * (indent + 2), ' ') + text + '\n';
    for (const char c : text) open_ += c == '{' ? 1 : c == '}' ? -1 : 0;
    block.operations += static_cast<int>(out_.operations - counted_);
    counted_ = out_.operations;
    block.defines.insert(block.defines.end(), defined_next_.begin(), defined_next_.end());
    defined_next_.clear();
  }
  template <class Write>
  void in_one_block(Write write) {
    one_block_ = true, begun_ = false;
    write();
    one_block_ = false;
  }
  // The next line defines `id`. Only lines outside of loops define names for later blocks.
  void defines(int indent, Id id) {
    if (indent == 0) defined_next_.push_back({name(id), nodes_[id].mask});
  }

  const Graph& graph_;
  const std::vector<Node>& nodes_;
  std::vector<int> uses_;
  std::vector<char> nested_;          // by node: it is written where it is used
  std::vector<int> subtracted_;       // by node: how many products with it are subtracted
  std::map<Id, std::string> given_;   // names
  std::map<std::string, int> taken_;  // by name: how many nodes have it
  std::set<Id> defined_;
  const Item* turning_in_ = nullptr;
  std::map<Id, std::vector<Id>> turning_;  // by angle: sines and cosines of that item
  std::vector<Definition> defined_next_;
  int open_ = 0;  // braces
  bool one_block_ = false, begun_ = false;
  long counted_ = 0;  // operations of the blocks so far
  Emitted out_;
};

}  // namespace

std::string Emitted::code() const {
  std::string all;
  for (const Block& block : blocks) all += block.code;
  return all;
}

Emitted emit_cpp(const Graph& graph) { return Writer(graph).write(); }

}  // namespace lockstep::codegen
