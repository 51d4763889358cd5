// SPDX-License-Identifier: Apache-2.0
#include "supports.h"

#include <algorithm>
#include <iterator>

#include "plan/limits.h"

namespace lockstep {

std::vector<Support> supports_of(const Program& program, const std::vector<RowForm>& forms, const Columns& columns) {
  std::vector<int> root(columns.n), seen(columns.n, -1);  // seen: by velocity, the last row that moves it
  for (int z = 0; z < columns.n; ++z) root[z] = columns.parent[z] < 0 ? z : root[columns.parent[z]];
  std::vector<Support> supports;
  long entries = 0;
  for (const RowForm& form : forms) {
    const auto row = static_cast<int>(supports.size());
    Support support;
    for (const auto& [index, contributions] : form.terms) {
      support.roots.push_back(root[index]);
      for (int j = index; j >= 0 && seen[j] != row; j = columns.parent[j]) {
        seen[j] = row;
        support.velocities.push_back(j);
      }
    }
    entries += static_cast<long>(support.velocities.size());
    require_room(program, entries, "the matrix of what its rows move");
    std::reverse(support.velocities.begin(), support.velocities.end());  // a path ascends then
    if (form.terms.size() > 1) std::sort(support.velocities.begin(), support.velocities.end());
    std::sort(support.roots.begin(), support.roots.end());
    support.roots.erase(std::unique(support.roots.begin(), support.roots.end()), support.roots.end());
    supports.push_back(std::move(support));
  }
  return supports;
}

bool share_any(const Support& a, const Support& b) {
  for (auto one = a.roots.begin(), other = b.roots.begin(); one != a.roots.end() && other != b.roots.end();) {
    if (*one == *other) return true;
    ++(*one < *other ? one : other);
  }
  return false;
}

std::vector<int> either(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  return all;
}

RowsByRoot rows_by_root(const std::vector<Support>& supports) {
  RowsByRoot rows;
  for (std::size_t r = 0; r < supports.size(); ++r)
    for (const int root : supports[r].roots) rows[root].push_back(static_cast<int>(r));
  return rows;
}

void add_runs(const std::vector<int>& numbers, std::vector<SupportRun>& runs) {
  const std::size_t first = runs.size();
  for (int j : numbers) {
    if (runs.size() > first && runs.back().last == j)
      ++runs.back().last;
    else
      runs.push_back({j, j + 1});
  }
}

}  // namespace lockstep
