// Drive targets over time, from a file. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "csv.h"
#include "lockstep/batch.h"

namespace lockstep::tool {

/// A row holds from the first step that starts no more than h/1000 before its time until the next row does;
/// before the first row the model's targets hold. Columns: time, then NAME (position target) or NAME.v
/// (velocity target) of driven joints.
class Targets {
 public:
  Targets() = default;  ///< no file: the model's targets hold
  /// Throws InputError for unknown or undriven joints and times that decrease.
  Targets(Table table, const Plan& plan);

  /// The row that holds at the step that starts at step_index * dt, -1 before the first.
  int row_at(long step_index, double dt) const;

  /// Puts a row's targets into all environments. Throws InputError for numbers that S cannot hold.
  template <class S>
  void apply(int row, Batch<S>& batch) const;

 private:
  struct Column {
    int dof;
    bool velocity;
  };
  Table table_;
  std::size_t time_ = 0;         ///< its column
  std::vector<Column> columns_;  ///< by column of the table; dof -1 for the time
};

}  // namespace lockstep::tool
