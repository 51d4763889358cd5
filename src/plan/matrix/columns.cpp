// Elimination trees: the structure of the sparse L^T D L factors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"

namespace lockstep {

Elimination elimination_tree(Pattern pattern) {
  const int n = static_cast<int>(pattern.size());
  std::vector<int> parent(n, -1);
  std::vector<std::vector<int>> children(n + 1);  // the last entry holds the roots
  for (int k = n - 1; k >= 0; --k)
    for (int i = k - 1; i >= 0; --i) {
      if (!pattern[k][i]) continue;
      if (parent[k] < 0) parent[k] = i;
      for (int j = 0; j < i; ++j) pattern[i][j] |= pattern[k][j];
    }
  for (int k = 0; k < n; ++k) children[parent[k] < 0 ? n : parent[k]].push_back(k);

  Elimination result;
  std::vector<int> renumbered(n);
  std::vector<int> stack(children[n].rbegin(), children[n].rend());
  while (!stack.empty()) {
    const int k = stack.back();
    stack.pop_back();
    renumbered[k] = static_cast<int>(result.order.size());
    result.order.push_back(k);
    result.parent.push_back(parent[k] < 0 ? -1 : renumbered[parent[k]]);
    stack.insert(stack.end(), children[k].rbegin(), children[k].rend());
  }
  return result;
}

Columns make_columns(const std::vector<int>& parent, TableStorage& storage) {
  const int n = static_cast<int>(parent.size());
  std::vector<int> size(n, 1), offset(n);
  for (int k = n - 1; k >= 0; --k)
    if (parent[k] >= 0) size[parent[k]] += size[k];
  int entries = 0;
  for (int k = 0; k < n; ++k) {
    offset[k] = entries;
    entries += size[k];
  }
  std::vector<int> row_start{0}, row;
  for (int i = 0; i < n; ++i) {
    for (int j = parent[i]; j >= 0; j = parent[j]) row.push_back(offset[j] + i - j);
    row_start.push_back(static_cast<int>(row.size()));
  }
  return {n,
          entries,
          storage.keep(parent),
          storage.keep(std::move(size)),
          storage.keep(std::move(offset)),
          storage.keep(std::move(row_start)),
          storage.keep(std::move(row))};
}

std::vector<int> columns_of_entries(const Columns& columns) {
  std::vector<int> column;
  for (int j = 0; j < columns.n; ++j) column.insert(column.end(), columns.size[j], j);
  return column;
}

int entry_of(const Columns& columns, int i, int j) {
  const int row = std::max(i, j), column = std::min(i, j);
  return row < column + columns.size[column] ? columns.offset[column] + row - column : -1;
}

}  // namespace lockstep
