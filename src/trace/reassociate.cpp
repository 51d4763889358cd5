#include "reassociate.h"

#include <algorithm>

#include "liveness.h"

namespace lockstep::trace {

namespace {

// Cycles until the result is there, of today's processors. Sine and cosine are eight multiply-adds one after the other.
// Choices take none: bounds that are idle, which add some, are to have no say in the order.
int takes(Op op) {
  switch (op) {
    case Op::add:
    case Op::subtract:
    case Op::multiply: return 3;
    case Op::fma:
    case Op::fnma: return 4;
    case Op::divide:
    case Op::sqrt: return 12;
    case Op::sine:
    case Op::cosine: return 8 * takes(Op::fma);
    default: return 0;
  }
}

// By node: the first sum that came out as it.
std::vector<int> makers(const Tracing& recording) {
  std::vector<int> made_by(recording.graph.nodes().size(), -1);
  for (std::size_t i = recording.sums.size(); i-- > 0;)
    made_by[recording.graph.without_sign(recording.sums[i].result)] = static_cast<int>(i);
  return made_by;
}

struct Side {
  explicit Side(const Tracing& recording)
      : graph(recording.graph),
        nodes(graph.nodes()),
        sums(recording.sums),
        used(use_counts(graph)),
        made_by(makers(recording)) {}

  Id operand(int sum, bool second) const { return graph.without_sign(second ? sums[sum].second : sums[sum].first); }

  // This sum wants it, and nothing else does, unless it is its negative that several want: each then adds it up.
  bool is_own(int sum, bool second) const {
    const Id result = graph.without_sign(sums[sum].result), id = operand(sum, second);
    return used[result] > 0 && used[id] == 1 && nodes[id].item >= 0 && nodes[id].item == nodes[result].item;
  }

  bool is_sum(Id id) const {
    const Op op = nodes[id].op;
    return op == Op::add || op == Op::subtract || op == Op::multiply || op == Op::fma || op == Op::fnma;
  }

  const Graph& graph;
  const std::vector<Node>& nodes;
  const std::vector<Sum>& sums;
  const std::vector<int> used, made_by;
};

class Finder {
 public:
  Finder(const Tracing& any, const Tracing& consistent)
      : terms(any.sums.size()),
        any_(any),
        in_place_(consistent),
        inner_(any.sums.size(), false),
        known_(in_place_.nodes.size(), 0) {
    for (int i = 0; i < count(); ++i)
      for (bool second : {false, true})
        if (const int j = sum_in(i, second); j >= 0) inner_[j] = true;
    for (Id id = 0; id < static_cast<Id>(known_.size()); ++id) known_[id] = when_made(id);
    for (int i = 0; i < count(); ++i)
      if (terms[i].empty() && !inner_[i]) add_up(i);
  }

  std::vector<std::vector<Term>> terms;

 private:
  int count() const { return static_cast<int>(terms.size()); }

  // The sum that becomes part of another one, -1 if none does.
  int sum_in(int sum, bool second) const {
    if (second && any_.sums[sum].factor >= 0) return -1;
    const Id id = any_.operand(sum, second), there = in_place_.operand(sum, second);
    const int made_by = any_.made_by[id];
    const bool becomes = made_by >= 0 && made_by < sum && any_.sums[made_by].stage == any_.sums[sum].stage &&
                         any_.is_own(sum, second) && in_place_.is_own(sum, second) && in_place_.is_sum(there);
    return becomes ? made_by : -1;
  }

  void take(int sum, bool minus, std::vector<Term>& all) const {
    const Sum& whole = any_.sums[sum];
    for (bool second : {false, true}) {
      Term term{sum, second, minus != (second && whole.subtracts), second && whole.factor >= 0};
      const Id id = any_.operand(sum, second);
      if (const int inner = sum_in(sum, second); inner >= 0) {
        take(inner, term.minus != (any_.sums[inner].result != (second ? whole.second : whole.first)), all);
        continue;
      }
      term.apart = term.apart || (any_.nodes[id].op == Op::multiply && any_.is_own(sum, second));
      all.push_back(term);
    }
  }

  // In place, where products may have become nothing.
  bool is_number(const Term& term) const {
    const Node& node = in_place_.nodes[in_place_.operand(term.sum, term.second)];
    return !term.apart && (node.op != Op::constant || node.value != 0.0);
  }

  int known(const Term& term) const {
    const Id id = in_place_.operand(term.sum, term.second), factor = in_place_.sums[term.sum].factor;
    if (term.second && factor >= 0) return std::max(known_[id], known_[in_place_.graph.without_sign(factor)]);
    return term.apart && in_place_.nodes[id].op == Op::multiply ? operands_known(id) : known_[id];
  }

  std::vector<Term> in_order(int sum) const {
    std::vector<Term> all;
    take(sum, false, all);
    std::stable_sort(all.begin(), all.end(), [&](const Term& a, const Term& b) { return known(a) < known(b); });
    const auto number = std::find_if(all.begin(), all.end(), [&](const Term& term) { return is_number(term); });
    if (number != all.end()) std::rotate(all.begin(), number, number + 1);
    return all;
  }

  // The same sum in another place, or its negative; or one that is the same in place only.
  void add_up(int sum) {
    const int first = any_.made_by[any_.graph.without_sign(any_.sums[sum].result)];
    if (first == sum || inner_[first]) {
      terms[sum] = in_order(sum);
      return;
    }
    if (terms[first].empty()) terms[first] = in_order(first);
    terms[sum] = terms[first];
    if (any_.sums[sum].result == any_.sums[first].result) return;
    for (Term& term : terms[sum]) term.minus = !term.minus;
  }

  int operands_known(Id id) const {
    int when = 0;
    for (Id o : in_place_.nodes[id].operand)
      if (o >= 0) when = std::max(when, known_[o]);
    return when;
  }

  int when_made(Id id) const {
    const int sum = in_place_.made_by[id];
    const Op op = in_place_.nodes[id].op;
    if (sum < 0 || inner_[sum] || !in_place_.is_sum(id) || op == Op::multiply) return operands_known(id) + takes(op);
    const std::vector<Term> all = in_order(sum);
    int when = known(all.front()) + (is_number(all.front()) ? 0 : takes(Op::multiply));
    for (std::size_t i = 1; i < all.size(); ++i)
      when = std::max(when, known(all[i])) + takes(all[i].apart ? Op::fma : Op::add);
    return when;
  }

  const Side any_, in_place_;
  std::vector<char> inner_;
  std::vector<int> known_;  // by node in place: in which cycle
};

}  // namespace

std::vector<std::vector<Term>> terms_of(const Tracing& any, const Tracing& consistent) {
  return Finder(any, consistent).terms;
}

}  // namespace lockstep::trace
