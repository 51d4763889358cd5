// Spreading tiles over the cores; the only place that knows oneTBB. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <memory>

#include "storage.h"

namespace lockstep {

class Workers {
 public:
  /// threads as in BatchOptions; each worker has `scratch_bytes` of its own.
  Workers(int threads, std::size_t scratch_bytes)
      : own_(scratch_bytes), scratch_([scratch_bytes] { return AlignedBlock<std::byte>(scratch_bytes); }), serial_(threads == 1) {
    if (threads > 1) arena_ = std::make_unique<tbb::task_arena>(threads);
  }

  /// act(first, last, scratch) over ranges of tiles that together are [0, tiles).
  template <class Act>
  void for_tiles(int tiles, const Act& act) {
    if (serial_) return act(0, tiles, own_.data());
    const auto all = [&] {
      tbb::parallel_for(
          tbb::blocked_range<int>(0, tiles, tiles_per_task),
          [&](const tbb::blocked_range<int>& range) { act(range.begin(), range.end(), scratch_.local().data()); },
          tbb::simple_partitioner());
    };
    arena_ ? arena_->execute(all) : all();
  }

 private:
  static constexpr int tiles_per_task = 32;  // some 20 microseconds: a task costs well under one

  AlignedBlock<std::byte> own_;
  tbb::enumerable_thread_specific<AlignedBlock<std::byte>> scratch_;
  std::unique_ptr<tbb::task_arena> arena_;
  bool serial_;
};

}  // namespace lockstep
