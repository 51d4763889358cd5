// SPDX-License-Identifier: Apache-2.0
#include "uses.h"

#include <algorithm>
#include <set>

namespace lockstep::jit {
namespace {

constexpr int rare = 100000;  // operations by which a use in a rare part counts as later

// A loop that is open, and the values from before it that each of its turns needs.
struct Loop {
  int begin;
  bool repeats;
  std::set<Value> through;
};

}  // namespace

Uses::Uses(const Listing& listing) : uses_(listing.home.size()), next_(listing.home.size(), 0) {
  std::vector<int> defined(listing.home.size(), -1);
  std::vector<Loop> loops;
  for (int i = 0; i < static_cast<int>(listing.operations.size()); ++i) {
    const Operation& o = listing.operations[static_cast<std::size_t>(i)];
    const auto use = [&](Value v, bool is_rare) {
      for (Loop& loop : loops)
        if (loop.repeats && defined[v] < loop.begin && !listing.fixed[v]) loop.through.insert(v);
      if (!uses_[v].empty() && uses_[v].back().at == i)
        uses_[v].back().rare = uses_[v].back().rare && is_rare;
      else
        uses_[v].push_back({i, is_rare});
    };
    for (Value v : o.from)
      if (v >= 0) use(v, false);
    if (o.op == Op::assign) loops.back().through.insert(o.to);
    if (o.op == Op::call || o.op == Op::call_if) {
      const StageCall& call = listing.calls[static_cast<std::size_t>(o.number)];
      for (const StageCall::Variable& variable : call.variables) {
        use(variable.before, false);
        defined[variable.after] = i;
      }
      for (const StageCall::Write& write : call.writes) use(write.value, true);
    }
    if (o.op == Op::run)
      for (Value v : listing.runs[static_cast<std::size_t>(o.number)].results) defined[v] = i;
    if (begins(o.op)) loops.push_back({i, o.number > 1, {}});
    if (ends(o.op)) {
      const std::set<Value> through = std::move(loops.back().through);
      loops.pop_back();
      for (Value v : through) use(v, false);
    }
    if (has_result(o.op)) defined[o.to] = i;
  }
}

int Uses::next(Value v) const {
  int soonest = never;
  for (std::size_t u = next_[v]; u < uses_[v].size(); ++u) {
    const Use& use = uses_[v][u];
    soonest = std::min(soonest, use.rare ? use.at + rare : use.at);
    if (!use.rare) break;
  }
  return soonest;
}

int Uses::next_behind(Value v) const {
  for (std::size_t u = next_[v]; u < uses_[v].size(); ++u)
    if (uses_[v][u].at > now_) return uses_[v][u].rare ? uses_[v][u].at + rare : uses_[v][u].at;
  return never;
}

}  // namespace lockstep::jit
