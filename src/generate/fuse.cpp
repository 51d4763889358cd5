#include "fuse.h"

#include <map>

#include "uses.h"

namespace lockstep::generate {

namespace {

class Finder {
 public:
  Finder(const Graph& graph, const std::vector<Sum>& sums) : nodes_(graph.nodes()), used_(uses(graph)) {
    // Which operand of a node comes first depends on what else was recorded; which of a sum does not.
    std::map<Id, Id> second;
    for (const Sum& sum : sums)
      if (sum.result >= 0) second.try_emplace(graph.without_sign(sum.result), graph.without_sign(sum.b));
    for (Id id = 0; id < static_cast<Id>(nodes_.size()); ++id) {
      const Node& node = nodes_[id];
      if (used_[id] == 0 || (node.op != Op::add && node.op != Op::subtract)) continue;
      const auto known = second.find(id);
      const bool swapped = node.op == Op::add && known != second.end() && known->second == node.operand[0];
      for (const int i : {swapped ? 0 : 1, swapped ? 1 : 0}) {
        if (!begins_with_product(node.operand[i], node.item)) continue;
        product_of[id] = node.operand[i];
        break;
      }
    }
  }

  std::map<Id, Id> product_of;  ///< by sum, or a sum of products

 private:
  // A product that nobody else wants, or one that others are added to.
  bool begins_with_product(Id id, int item) const {
    const Node& node = nodes_[id];
    if (used_[id] != 1 || node.item != item) return false;
    if (node.op == Op::multiply) return true;
    if (node.op == Op::fma || node.op == Op::fnma) return begins_with_product(node.operand[2], item);
    const auto sum = product_of.find(id);
    return sum != product_of.end() && begins_with_product(node.operand[sum->second == node.operand[0] ? 1 : 0], item);
  }

  const std::vector<Node>& nodes_;
  const std::vector<int> used_;
};

}  // namespace

std::vector<Fuses> fuses_of(const Graph& graph, const std::vector<Sum>& sums) {
  const std::map<Id, Id> product_of = Finder(graph, sums).product_of;
  std::vector<Fuses> fuses;
  for (const Sum& sum : sums) {
    if (sum.result < 0) {
      fuses.push_back(Fuses::none);
      continue;
    }
    const auto known = product_of.find(graph.without_sign(sum.result));
    const auto is_product = [&](Id operand) {
      return known != product_of.end() && graph.without_sign(operand) == known->second;
    };
    fuses.push_back(is_product(sum.a) ? Fuses::first : is_product(sum.b) ? Fuses::second : Fuses::none);
  }
  return fuses;
}

}  // namespace lockstep::generate
