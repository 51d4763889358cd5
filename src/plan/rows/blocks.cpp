// K of rows in blocks of some rows and columns. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>

#include "plan/limits.h"
#include "supports.h"

namespace lockstep {
namespace {

// Velocities that any of these rows moves.
std::vector<SupportRun> moved_by_any(const std::vector<Support>& supports, int first, int number) {
  std::vector<int> moved;
  for (int r = first; r < first + number; ++r) moved = either(moved, supports[r].velocities);
  std::vector<SupportRun> runs;
  add_runs(moved, runs);
  return runs;
}

// Adds what is in both.
void add_common(const std::vector<SupportRun>& a, const std::vector<SupportRun>& b, std::vector<SupportRun>& runs) {
  for (auto one = a.begin(), other = b.begin(); one != a.end() && other != b.end();) {
    const int first = std::max(one->first, other->first), last = std::min(one->last, other->last);
    if (first < last) runs.push_back({first, last});
    ++(one->last < other->last ? one : other);
  }
}

// By its first column: the blocks of `height` rows from `row` on that may have entries.
std::vector<int> columns_beside(const std::vector<Support>& supports, const RowsByRoot& by_root, int row, int height) {
  std::vector<int> roots = supports[row].roots, columns;
  if (height > 1) roots = either(roots, supports[row + 1].roots);
  for (const int root : roots)
    for (const int s : by_root.at(root)) {
      if (s >= row + height) break;
      const int column = s - s % RowBlock::most_columns;
      if (columns.empty() || columns.back() != column) columns.push_back(column);
    }
  if (roots.size() == 1) return columns;
  std::sort(columns.begin(), columns.end());
  columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
  return columns;
}

}  // namespace

void lay_out_blocks(Program& program, const std::vector<Support>& supports, bool factored, Rows<double>& rows) {
  static_assert(RowBlock::most_rows == 2);
  const auto count = static_cast<int>(supports.size());
  const RowsByRoot by_root = rows_by_root(supports);
  std::map<int, std::vector<SupportRun>> moved_by_columns;  // by first column, of whole blocks
  std::vector<RowBlock> blocks;
  std::vector<SupportRun> block_runs;
  std::vector<std::vector<int>> neighbours(count);  // ascending
  const auto place = [&](int r, int s) {
    return factored ? entry_of(rows.columns, r, s) : static_cast<int>(static_cast<long>(r) * count + s);
  };
  long entries = 0;
  for (int row = 0; row < count; row += RowBlock::most_rows) {
    const int height = std::min(RowBlock::most_rows, count - row);
    const std::vector<SupportRun> moved_by_rows = moved_by_any(supports, row, height);
    for (const int column : columns_beside(supports, by_root, row, height)) {
      const int width = std::min(RowBlock::most_columns, row + height - column);
      RowBlock block{row, height, column, width, static_cast<int>(block_runs.size()), 0, {}, {}};
      bool any = false;
      for (int i = 0; i < RowBlock::most_rows; ++i)
        for (int k = 0; k < RowBlock::most_columns; ++k) {
          block.entry[i][k] = block.mirror[i][k] = -1;
          const int r = row + i, s = column + k;
          if (i >= height || k >= width || s > r || !share_any(supports[r], supports[s])) continue;
          any = true;
          block.entry[i][k] = place(r, s);
          block.mirror[i][k] = factored ? block.entry[i][k] : place(s, r);
          ++entries;
          if (factored) continue;
          neighbours[r].push_back(s);
          if (s != r) neighbours[s].push_back(r);
        }
      if (!any) continue;
      require_room(program, entries, the_response_matrix);
      if (width < RowBlock::most_columns) {
        add_common(moved_by_rows, moved_by_any(supports, column, width), block_runs);
      } else {
        const auto [moved, is_new] = moved_by_columns.try_emplace(column);
        if (is_new) moved->second = moved_by_any(supports, column, width);
        add_common(moved_by_rows, moved->second, block_runs);
      }
      block.run_last = static_cast<int>(block_runs.size());
      blocks.push_back(block);
    }
  }

  std::vector<int> neighbour_start{0};
  std::vector<SupportRun> neighbour_runs;
  for (const std::vector<int>& list : neighbours) {
    add_runs(list, neighbour_runs);
    neighbour_start.push_back(static_cast<int>(neighbour_runs.size()));
  }
  const long all = factored ? rows.columns.entries : static_cast<long>(count) * (count + 1) / 2;
  rows.response_entries = factored ? rows.columns.entries : place(count, 0);
  rows.dense = entries == all;
  rows.blocks = program.storage.keep(std::move(blocks));
  rows.block_runs = program.storage.keep(std::move(block_runs));
  rows.neighbour_start = program.storage.keep(std::move(neighbour_start));
  rows.neighbours = program.storage.keep(std::move(neighbour_runs));
}

}  // namespace lockstep
