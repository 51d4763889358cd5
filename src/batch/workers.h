// Spreads environments over threads; the only file that uses oneTBB. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <memory>

#include "storage.h"

namespace lockstep {

class Workers {
 public:
  /// `threads` as in BatchOptions. Each thread has `scratch_bytes` of its own.
  Workers(int threads, std::size_t scratch_bytes)
      : own_(scratch_bytes),
        scratch_([scratch_bytes] { return AlignedBlock<std::byte>(scratch_bytes); }),
        serial_(threads == 1) {
    if (threads > 1) arena_ = std::make_unique<tbb::task_arena>(threads);
  }

  /// Calls act(first, last, scratch) for ranges of environments that cover [0, count). Ranges begin at cache lines, so
  /// no two threads write to the same line. One environment takes about `nanoseconds`. Groups of `group` environments,
  /// a power of two, are faster: they are not split if there is one for each thread.
  template <class Act>
  void for_environments(std::ptrdiff_t count, double nanoseconds, std::ptrdiff_t group, const Act& act) {
    if (serial_) return act(0, count, own_.data());
    const auto all = [&] {
      const int threads = tbb::this_task_arena::max_concurrency();
      const bool enough = count >= threads * group;
      const std::ptrdiff_t unit = enough ? std::max(per_line, group) : per_line;
      const std::ptrdiff_t units = (count + unit - 1) / unit;
      tbb::parallel_for(
          tbb::blocked_range<std::ptrdiff_t>(0, units,
                                             units_per_task(units, nanoseconds * static_cast<double>(unit), threads)),
          [&](const tbb::blocked_range<std::ptrdiff_t>& range) {
            act(range.begin() * unit, std::min(range.end() * unit, count), scratch_.local().data());
          },
          tbb::simple_partitioner());
    };
    arena_ ? arena_->execute(all) : all();
  }

 private:
  static constexpr std::ptrdiff_t per_line = cache_line / 4;  // environments in a line of the smallest type

  // Each task has a cost of its own, so tasks are long if there is much to do. They are short rather than leaving
  // threads without work.
  static constexpr int tasks_per_thread = 16;
  static std::ptrdiff_t units_per_task(std::ptrdiff_t units, double unit_nanoseconds, int threads) {
    constexpr double shortest = 10e3, longest = 50e3;
    const double share = static_cast<double>(units) / (tasks_per_thread * threads);
    const double grain = std::clamp(share, shortest / unit_nanoseconds, longest / unit_nanoseconds);
    return static_cast<std::ptrdiff_t>(std::clamp(grain, 1.0, static_cast<double>(units)));
  }

  AlignedBlock<std::byte> own_;
  tbb::enumerable_thread_specific<AlignedBlock<std::byte>> scratch_;
  std::unique_ptr<tbb::task_arena> arena_;
  bool serial_;
};

}  // namespace lockstep
