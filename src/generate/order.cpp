#include <algorithm>
#include <map>
#include <optional>

#include "made.h"

namespace lockstep::generate {
namespace {

// So many operations ahead are looked for one of the same kind: runs get longer, values live longer.
constexpr int window = 60;

}  // namespace

void move_in_order(std::vector<Made>& pending, int values, std::vector<Made>& ordered) {
  if (pending.empty()) return;
  std::vector<std::size_t> maker(static_cast<std::size_t>(values), pending.size());
  for (std::size_t i = 0; i < pending.size(); ++i)
    for (Value v : {pending[i].to, pending[i].also_to})
      if (v >= 0) maker[v] = i;
  std::vector<int> missing(pending.size());  // operands that are not made yet
  std::vector<std::vector<std::size_t>> users(pending.size());
  for (std::size_t i = 0; i < pending.size(); ++i)
    for (Value v : pending[i].from)
      if (v >= 0 && maker[v] < pending.size()) {
        ++missing[i];
        users[maker[v]].push_back(i);
      }
  std::vector<std::size_t> open;  // the first that are left
  std::size_t opened = 0;
  std::optional<Does> kind;
  const auto next_of_kind = [&] {
    return std::find_if(open.begin(), open.end(),
                        [&](std::size_t i) { return pending[i].does == kind && missing[i] == 0; });
  };
  for (std::size_t left = pending.size(); left > 0; --left) {
    while (opened < pending.size() && open.size() < window) open.push_back(opened++);
    auto next = next_of_kind();
    if (next == open.end()) {
      std::map<Does, int> ready;
      for (std::size_t i : open)
        if (missing[i] == 0) ++ready[pending[i].does];
      kind = std::max_element(ready.begin(), ready.end(), [](const auto& a, const auto& b) {
               return a.second < b.second;
             })->first;
      next = next_of_kind();
    }
    for (std::size_t user : users[*next]) --missing[user];
    ordered.push_back(std::move(pending[*next]));
    open.erase(next);
  }
  pending.clear();
}

}  // namespace lockstep::generate
