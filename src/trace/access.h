// Where the numbers of a traced step stand in memory, and which stages it calls. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// Stages that look at what is in the lanes before they know what to do: they are called, as the tables' kernels call
/// them.
enum class Call : int { none, solve_bounds, coupling_impulses, diagnose, hold };

/// Where a number stands that is read or written.
struct Access {
  /// From 0 on the tile's arrays, in the order of kernels::arrays(); from first_row on rows of the batch.
  enum : int {
    frozen = -1,
    singular = -2,
    failed = -3,
    candidate = -4,
    nowhere = -5,
    first_row = 1000,
    position_target = first_row,
    velocity_target,
    effort,
    field
  };
  int slot, array, number;
};

}  // namespace lockstep
