// Spreading tiles over the cores; the only place that knows oneTBB. SPDX-License-Identifier: Apache-2.0
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
  /// threads as in BatchOptions; each worker has `scratch_bytes` of its own.
  Workers(int threads, std::size_t scratch_bytes)
      : own_(scratch_bytes),
        scratch_([scratch_bytes] { return AlignedBlock<std::byte>(scratch_bytes); }),
        serial_(threads == 1) {
    if (threads > 1) arena_ = std::make_unique<tbb::task_arena>(threads);
  }

  /// act(first, last, scratch) over ranges of environments that together are [0, count). They begin with lines of the
  /// cache, so that no two threads write to one. `each` is about what one environment takes, in nanoseconds; so many
  /// are faster `together`, a power of two: they stay together where there is a group of them for each thread.
  template <class Act>
  void for_environments(std::ptrdiff_t count, double each, std::ptrdiff_t together, const Act& act) {
    if (serial_) return act(0, count, own_.data());
    const auto all = [&] {
      const int threads = tbb::this_task_arena::max_concurrency();
      const bool enough = count >= threads * together;
      const std::ptrdiff_t unit = enough ? std::max(per_line, together) : per_line;
      const std::ptrdiff_t units = (count + unit - 1) / unit;
      tbb::parallel_for(
          tbb::blocked_range<std::ptrdiff_t>(0, units,
                                             units_per_task(units, each * static_cast<double>(unit), threads)),
          [&](const tbb::blocked_range<std::ptrdiff_t>& range) {
            act(range.begin() * unit, std::min(range.end() * unit, count), scratch_.local().data());
          },
          tbb::simple_partitioner());
    };
    arena_ ? arena_->execute(all) : all();
  }

 private:
  static constexpr std::ptrdiff_t per_line = cache_line / 4;  // environments in a line of the smallest type

  // A task costs some 0.2 microseconds, a stolen one more: long ones where there are many, short ones rather than
  // threads with nothing to do.
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
