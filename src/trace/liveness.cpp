// Use counts, from the stores backwards. SPDX-License-Identifier: Apache-2.0
#include "liveness.h"

#include <algorithm>
#include <set>

namespace lockstep::trace {
namespace {

class Counter {
 public:
  explicit Counter(const Graph& graph) : graph_(graph), uses_(graph.nodes().size(), 0) {}

  std::vector<int> count() {
    for (const Item& item : graph_.items()) {
      if (item.subroutine >= 0) continue;
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
    const Item& item = graph_.items()[static_cast<std::size_t>(graph_.nodes()[id].item)];
    if (item.subroutine >= 0) {
      for (const Write& argument : item.stores) use(argument.value);
      return;
    }
    const auto found = std::find(item.variable.begin(), item.variable.end(), id);
    const auto i = static_cast<std::size_t>(found - item.variable.begin());
    use(item.start[i]);
    if (item.kind == Item::effect) return;
    if (item.condition >= 0) use(item.condition);
    if (item.again >= 0) use(item.again);
    use(item.next[i]);
    ++uses_[item.next[i]];  // so it gets a name, which is set before any variable changes
  }

  const Graph& graph_;
  std::vector<int> uses_;
};

}  // namespace

std::vector<int> use_counts(const Graph& graph) { return Counter(graph).count(); }

void drop_unread_results(Graph& graph) {
  const std::size_t count = graph.subroutines.size();
  for (bool changed = true; changed;) {
    std::vector<std::set<int>> wanted(count), read(count);
    const auto each_graph = [&](auto act) {
      act(graph);
      for (const auto& subroutine : graph.subroutines) act(*subroutine);
    };
    each_graph([&](const Graph& own) {
      const std::vector<int> uses = use_counts(own);
      for (const Item& item : own.items())
        for (std::size_t i = 0; item.subroutine >= 0 && i < item.variable.size(); ++i)
          if (uses[item.variable[i]] > 0) wanted[item.subroutine].insert(item.place[i].number);
    });
    const auto keep = [&](std::vector<Write>& writes, const std::set<int>& those) {
      if (std::erase_if(writes, [&](const Write& write) { return !those.contains(write.place.number); }) > 0)
        changed = true;
    };
    changed = false;
    for (std::size_t s = 0; s < count; ++s) {
      keep(graph.subroutines[s]->items().back().stores, wanted[s]);
      const std::vector<int> own_uses = use_counts(*graph.subroutines[s]);
      for (Id id = 0; id < static_cast<Id>(own_uses.size()); ++id)
        if (const Place& place = graph.subroutines[s]->nodes()[id].place;
            own_uses[id] > 0 && place.array == Access::handed)
          read[s].insert(place.number);
    }
    each_graph([&](Graph& own) {
      for (Item& item : own.items())
        if (item.subroutine >= 0) keep(item.stores, read[item.subroutine]);
    });
  }
}

}  // namespace lockstep::trace
