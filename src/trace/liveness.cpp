#include "liveness.h"

namespace lockstep::trace {
namespace {

class Finder {
 public:
  explicit Finder(const Graph& graph) : graph_(graph), uses_(graph.nodes().size(), 0) {}

  std::vector<int> find() {
    for (const Item& item : graph_.items()) {
      for (const Write& store : item.stores) use(store.value);
      if (item.condition < 0) continue;
      use(item.condition);
      for (Id variable : item.variable) use(variable);
    }
    return std::move(uses_);
  }

 private:
  void use(Id id) {
    if (uses_[id]++ > 0) return;
    const Node& node = graph_.nodes()[id];
    if (node.op == Op::variable && node.operand[0] < 0) use_what_it_becomes(id);
    for (Id o : node.operand)
      if (o >= 0) use(o);
  }

  void use_what_it_becomes(Id id) {
    for (const Item& item : graph_.items())
      for (std::size_t i = 0; i < item.variable.size(); ++i) {
        if (item.variable[i] != id) continue;
        use(item.start[i]);
        if (item.kind != Item::loop) continue;
        use(item.next[i]);
        ++uses_[item.next[i]];  // named before any variable changes
      }
  }

  const Graph& graph_;
  std::vector<int> uses_;
};

}  // namespace

std::vector<int> use_counts(const Graph& graph) { return Finder(graph).find(); }

}  // namespace lockstep::trace
