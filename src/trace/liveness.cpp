// Use counts, from the stores backwards. SPDX-License-Identifier: Apache-2.0
#include "liveness.h"

namespace lockstep::trace {
namespace {

class Counter {
 public:
  explicit Counter(const Graph& graph) : graph_(graph), uses_(graph.nodes().size(), 0) {}

  std::vector<int> count() {
    for (const Item& item : graph_.items()) {
      for (const Write& store : item.stores) use(store.value);
      if (item.condition < 0 || item.kind != Item::effect) continue;
      use(item.condition);
      for (Id variable : item.variable) use(variable);
    }
    return std::move(uses_);
  }

 private:
  void use(Id id) {
    if (uses_[id]++ > 0) return;
    const Node& node = graph_.nodes()[id];
    if (node.op == Op::variable && node.operand[0] < 0) use_values_of(id);
    for (Id o : node.operand)
      if (o >= 0) use(o);
  }

  void use_values_of(Id id) {
    for (const Item& item : graph_.items())
      for (std::size_t i = 0; i < item.variable.size(); ++i) {
        if (item.variable[i] != id) continue;
        use(item.start[i]);
        if (item.kind == Item::effect) continue;
        if (item.condition >= 0) use(item.condition);
        if (item.again >= 0) use(item.again);
        use(item.next[i]);
        ++uses_[item.next[i]];  // so it gets a name, which is set before any variable changes
      }
  }

  const Graph& graph_;
  std::vector<int> uses_;
};

}  // namespace

std::vector<int> use_counts(const Graph& graph) { return Counter(graph).count(); }

}  // namespace lockstep::trace
