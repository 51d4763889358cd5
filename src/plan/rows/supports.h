// What the impulses of rows move. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "plan/layout.h"

namespace lockstep {

/// Velocities that an impulse on a row moves: the row's terms and all their ancestors, as L^-T has them. Both lists
/// ascend.
struct Support {
  std::vector<int> velocities;
  std::vector<int> roots;  ///< of its trees of ancestors: two rows share a velocity if they share a root
};

/// By form. Throws ModelError where they are too many (rows/supports.cpp).
std::vector<Support> supports_of(const Program& program, const std::vector<RowForm>& forms, const Columns& columns);

bool share_any(const Support& a, const Support& b);
std::vector<int> either(const std::vector<int>& a, const std::vector<int>& b);

/// Adds ascending numbers as runs.
void add_runs(const std::vector<int>& numbers, std::vector<SupportRun>& runs);

/// By root: the rows that have it, ascending.
using RowsByRoot = std::map<int, std::vector<int>>;
RowsByRoot rows_by_root(const std::vector<Support>& supports);

/// K in blocks, without those that are zero. Where K is swept, rows know their neighbours in it (rows/blocks.cpp).
void lay_out_blocks(Program& program, const std::vector<Support>& supports, bool factored, Rows<double>& rows);

}  // namespace lockstep
