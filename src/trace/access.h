// The places of a traced step's numbers in memory, and the stages that it calls. SPDX-License-Identifier: Apache-2.0
#pragma once

namespace lockstep {

/// Stages whose work depends on the values in the lanes. A traced step calls them as they are. `bounds` looks for
/// active bounds first.
enum class Call : int { none, bounds, solve_bounds, coupling_impulses, diagnose, hold, step_again, halves, quarters };

/// A read or write of a number in memory.
struct Access {
  /// What `array` may be. From 0 on: arrays of the tile, in the order of kernels::arrays(). From first_row on: rows of
  /// the batch.
  enum : int {
    nowhere = -1,
    own = -2,     ///< numbers and masks outside arrays, in the order of kernels::each_own()
    failed = -3,  ///< lanes, for hold()
    handed = -4,  ///< to a subroutine, and back
    first_row = 1000,
    position_target = first_row,
    velocity_target,
    effort,
    field
  };
  int slot, array, number;
};

}  // namespace lockstep
