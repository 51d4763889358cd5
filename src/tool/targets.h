// Drive targets over time, from a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "csv.h"
#include "lockstep/batch.h"

namespace lockstep::tool {

/// Columns: time, then NAME (position target) or NAME.v (velocity target) of joints with a drive. A row holds from the
/// first step that starts at its time, or up to h/1000 before, until the next row takes over. Before the first row the
/// model's targets hold.
class Targets {
 public:
  Targets() = default;  ///< no file: the model's targets hold
  /// Throws InputError for unknown joints, joints without a drive, and times that decrease.
  Targets(Table table, const Plan& plan);

  /// The row that holds in the step that starts at step_index * dt; -1 before the first row.
  int row_at(long step_index, double dt) const;

  /// Writes a row's targets into all environments. Throws InputError for numbers that S cannot hold.
  template <class S>
  void apply(int row, Batch<S>& batch) const;

 private:
  struct Column {
    int dof;
    bool velocity;
  };
  Table table_;
  std::size_t time_ = 0;         ///< its column
  std::vector<Column> columns_;  ///< by column of the table; dof is -1 for the time
};

}  // namespace lockstep::tool
