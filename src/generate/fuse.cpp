#include "fuse.h"

#include <map>

#include "uses.h"

namespace lockstep::generate {

std::vector<Fuses> fuses_of(const Graph& graph, const std::vector<Sum>& sums) {
  const std::vector<Node>& nodes = graph.nodes();
  const std::vector<int> used = uses(graph);
  std::map<Id, Id> product_of;  // by sum
  for (Id id = 0; id < static_cast<Id>(nodes.size()); ++id) {
    const Node& node = nodes[id];
    if (used[id] == 0 || (node.op != Op::add && node.op != Op::subtract)) continue;
    for (int i : {1, 0}) {
      const Id o = node.operand[i];
      if (nodes[o].op != Op::multiply || used[o] != 1 || nodes[o].item != node.item) continue;
      product_of[id] = o;
      break;
    }
  }
  std::vector<Fuses> fuses;
  for (const Sum& sum : sums) {
    const auto known = product_of.find(graph.without_sign(sum.result));
    const auto is_product = [&](Id operand) {
      return known != product_of.end() && graph.without_sign(operand) == known->second;
    };
    fuses.push_back(is_product(sum.a) ? Fuses::first : is_product(sum.b) ? Fuses::second : Fuses::none);
  }
  return fuses;
}

}  // namespace lockstep::generate
