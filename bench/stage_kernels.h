// The first stages of a step as plain functions, to time and to count. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "kernels/tile/state_pointers.h"
#include "plan/tables.h"

namespace lockstep::bench {

/// For AVX2, with eight environments in a tile; compiled with the flags of the library's kernels.
struct StageKernels {
  static constexpr int lanes = 8;
  static std::size_t scratch_bytes(const Tables<float>& t);
  /// Runs the first `stages` of a step `repeats` times, each time from the state of `start`.
  static void run(const Tables<float>& t, const StatePointers<float>& start, const StatePointers<float>& batch,
                  void* scratch, int stages, long repeats);
};

int stage_count();
const char* stage_name(int stage);
bool stage_present(const Tables<float>& t, int stage);
/// Flops of the first `stages` for one environment. They run on a number that counts its operations.
long stage_flops(const Tables<float>& t, const StatePointers<float>& batch, int stages);

}  // namespace lockstep::bench
