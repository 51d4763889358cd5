// What machine code and the kernels know of each other. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "kernels/tile/routine_code.h"
#include "plan/tables.h"
#include "trace/access.h"

namespace lockstep::jit {

/// The bases of a tile's numbers in memory. Machine code adds constant offsets to them.
struct Frame {
  void* block;  ///< the arrays of the tile
  /// Slot 0: lanes that failed; then the rows of the batch that the code reads; then what is handed to subroutines;
  /// then the code's own.
  void* slots;
  void* tile;  ///< kernels::Tile<T>
  const void* tables;
  const void* batch;  ///< StatePointers<S>, at the tile
};

/// Runs a stage of the library that the code does not have itself: the frame of the tile, and the number of the Call.
using CallStage = void (*)(const Frame*, int);

/// Where a tile's numbers stand, in bytes from the bases.
struct TilePlaces {
  static constexpr int most_arrays = 512;
  static constexpr int most_own = 32;
  std::ptrdiff_t first[most_arrays];  ///< of each array in memory order, from Frame::block
  int arrays = 0;
  std::ptrdiff_t own[most_own];  ///< of what stands outside arrays (Access::own), from Frame::tile
  int bytes = 0;                 ///< of a register
  bool fused = false;            ///< fma() rounds once
  CallStage call = nullptr;
};

/// The step of one plan as machine code for one instruction set and precision.
struct StepCode {
  /// Takes one step of the tiles [first, last), which are at most `tiles`.
  using Function = void (*)(const Frame* first, const Frame* last);
  Function any = nullptr;
  Function consistent = nullptr;  ///< the shorter step of tiles of consistent followers, null if there is none
  /// Without code of the step: that of its routines. They take one tile at a time.
  kernels::RoutineCode routine[kernels::routine_count] = {};
  int tiles = 1;        ///< that go through the parts of a long step together
  int slots = 0;        ///< of each tile
  Span<Access> rows;    ///< of the batch, in the order of their slots
  Span<Access> unread;  ///< input rows on which no routine depends: NaN in them is a fault all the same
};

}  // namespace lockstep::jit
