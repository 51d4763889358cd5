// Elimination trees: the structure of the sparse L^T D L factors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {

void Pattern::join_all(std::vector<int>& rows) {
  std::sort(rows.begin(), rows.end());
  for (std::size_t i = 1; i < rows.size(); ++i) join(rows[i - 1], rows[i]);
}

void Pattern::join(int a, int b) {
  if (a != b) later_[static_cast<std::size_t>(std::min(a, b))].push_back(std::max(a, b));
}

// A row's parent is the first one above it to which a path of rows from there on leads. The parts that such paths make
// are grown from the last row up, and each knows the row by which it was joined last.
Elimination elimination_tree(const Pattern& pattern) {
  const int n = pattern.size();
  std::vector<int> parent(n, -1), above(n, -1);   // above: on the way to the first row of its part
  std::vector<std::vector<int>> children(n + 1);  // the last entry holds the roots
  for (int i = n - 1; i >= 0; --i)
    for (int k : pattern.later(i))
      while (k != i) {
        const int next = above[k];
        above[k] = i;
        if (next < 0) parent[k] = i;
        k = next < 0 ? i : next;
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
  std::vector<int> row_start{0}, row, ancestors(n, 0);
  for (int i = 0; i < n; ++i) {
    if (parent[i] >= 0) ancestors[i] = ancestors[parent[i]] + 1;
    row_start.push_back(row_start.back() + ancestors[i]);
    if (entries > most_entries) continue;  // no step has such a matrix
    for (int j = parent[i]; j >= 0; j = parent[j]) row.push_back(offset[j] + i - j);
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
