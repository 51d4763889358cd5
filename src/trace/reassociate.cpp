// Reassociates sums: finds inner sums, and orders terms by when they are known. SPDX-License-Identifier: Apache-2.0
#include "reassociate.h"

#include <algorithm>

#include "liveness.h"

namespace lockstep::trace {

namespace {

// Latency in cycles, of today's processors. Sine and cosine are eight dependent multiply-adds. Selections count as
// zero: inactive bounds add some, and may not change the order.
int latency(Op op) {
  switch (op) {
    case Op::add:
    case Op::subtract:
    case Op::multiply: return 3;
    case Op::fma:
    case Op::fnma: return 4;
    case Op::divide:
    case Op::sqrt: return 12;
    case Op::sine:
    case Op::cosine: return 8 * latency(Op::fma);
    default: return 0;
  }
}

// By node: the first sum whose result it is, -1 if none.
std::vector<int> makers(const Tracing& tracing) {
  std::vector<int> made_by(tracing.graph.nodes().size(), -1);
  for (std::size_t i = tracing.sums.size(); i-- > 0;)
    made_by[tracing.graph.without_sign(tracing.sums[i].result)] = static_cast<int>(i);
  return made_by;
}

struct Side {
  explicit Side(const Tracing& tracing)
      : graph(tracing.graph),
        nodes(graph.nodes()),
        sums(tracing.sums),
        used(use_counts(graph)),
        made_by(makers(tracing)) {}

  Id operand(int sum, bool second) const { return graph.without_sign(second ? sums[sum].second : sums[sum].first); }

  // Whether only this sum uses the operand. Several sums may use the operand's negative: each then adds it up itself.
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
        consistent_(consistent),
        inner_(any.sums.size(), false),
        known_(consistent_.nodes.size(), 0) {
    for (int i = 0; i < count(); ++i)
      for (bool second : {false, true})
        if (const int j = inner_sum(i, second); j >= 0) inner_[j] = true;
    for (Id id = 0; id < static_cast<Id>(known_.size()); ++id) known_[id] = when_known(id);
    for (int i = 0; i < count(); ++i)
      if (terms[i].empty() && !inner_[i]) set_terms(i);
  }

  std::vector<std::vector<Term>> terms;

 private:
  int count() const { return static_cast<int>(terms.size()); }

  // The operand as an inner sum, which becomes part of this one; -1 if it is none.
  int inner_sum(int sum, bool second) const {
    if (second && any_.sums[sum].factor >= 0) return -1;
    const Id id = any_.operand(sum, second), consistent = consistent_.operand(sum, second);
    const int made_by = any_.made_by[id];
    const bool is_inner = made_by >= 0 && made_by < sum && any_.sums[made_by].stage == any_.sums[sum].stage &&
                          any_.is_own(sum, second) && consistent_.is_own(sum, second) && consistent_.is_sum(consistent);
    return is_inner ? made_by : -1;
  }

  void collect_terms(int sum, bool minus, std::vector<Term>& all) const {
    const Sum& whole = any_.sums[sum];
    for (bool second : {false, true}) {
      Term term{sum, second, minus != (second && whole.subtracts), second && whole.factor >= 0};
      const Id id = any_.operand(sum, second);
      if (const int inner = inner_sum(sum, second); inner >= 0) {
        collect_terms(inner, term.minus != (any_.sums[inner].result != (second ? whole.second : whole.first)), all);
        continue;
      }
      term.apart = term.apart || (any_.nodes[id].op == Op::multiply && any_.is_own(sum, second));
      all.push_back(term);
    }
  }

  // Whether the term is neither a product nor zero. In `consistent` products may have become zero.
  bool is_number(const Term& term) const {
    const Node& node = consistent_.nodes[consistent_.operand(term.sum, term.second)];
    return !term.apart && (node.op != Op::constant || node.value != 0.0);
  }

  // When the term's operands are known.
  int known(const Term& term) const {
    const Id id = consistent_.operand(term.sum, term.second), factor = consistent_.sums[term.sum].factor;
    if (term.second && factor >= 0) return std::max(known_[id], known_[consistent_.graph.without_sign(factor)]);
    return term.apart && consistent_.nodes[id].op == Op::multiply ? operands_known(id) : known_[id];
  }

  std::vector<Term> ordered_terms(int sum) const {
    std::vector<Term> all;
    collect_terms(sum, false, all);
    std::stable_sort(all.begin(), all.end(), [&](const Term& a, const Term& b) { return known(a) < known(b); });
    const auto number = std::find_if(all.begin(), all.end(), [&](const Term& term) { return is_number(term); });
    if (number != all.end()) std::rotate(all.begin(), number, number + 1);
    return all;
  }

  // A sum that repeats an earlier one, or the negative of one, has the same terms.
  void set_terms(int sum) {
    const int first = any_.made_by[any_.graph.without_sign(any_.sums[sum].result)];
    if (first == sum || inner_[first]) {
      terms[sum] = ordered_terms(sum);
      return;
    }
    if (terms[first].empty()) terms[first] = ordered_terms(first);
    terms[sum] = terms[first];
    if (any_.sums[sum].result == any_.sums[first].result) return;
    for (Term& term : terms[sum]) term.minus = !term.minus;
  }

  int operands_known(Id id) const {
    int when = 0;
    for (Id o : consistent_.nodes[id].operand)
      if (o >= 0) when = std::max(when, known_[o]);
    return when;
  }

  int when_known(Id id) const {
    const int sum = consistent_.made_by[id];
    const Op op = consistent_.nodes[id].op;
    if (sum < 0 || inner_[sum] || !consistent_.is_sum(id) || op == Op::multiply)
      return operands_known(id) + latency(op);
    const std::vector<Term> all = ordered_terms(sum);
    int when = known(all.front()) + (is_number(all.front()) ? 0 : latency(Op::multiply));
    for (std::size_t i = 1; i < all.size(); ++i)
      when = std::max(when, known(all[i])) + latency(all[i].apart ? Op::fma : Op::add);
    return when;
  }

  const Side any_, consistent_;
  std::vector<char> inner_;
  std::vector<int> known_;  // by node of `consistent`: in which cycle it is known
};

}  // namespace

std::vector<std::vector<Term>> terms_of(const Tracing& any, const Tracing& consistent) {
  return Finder(any, consistent).terms;
}

}  // namespace lockstep::trace
