// Spreads environments over threads; it and processors.cpp alone use oneTBB. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "lockstep/error.h"
#include "processors.h"
#include "simd/floating_point_mode.h"
#include "storage.h"

namespace lockstep {

inline constexpr int most_threads = 1024;

class Workers {
 public:
  /// `threads` and `memory_domain` as in BatchOptions. Takes `scratch_bytes` for each thread, so that a step takes
  /// none.
  Workers(int threads, int memory_domain, std::size_t scratch_bytes)
      : threads_(checked(threads)), domain_(checked_domain(memory_domain)) {
    if (const int own = own_threads(); own > 1 || (own == 1 && domain_ >= 0)) {
      const int node = domain_ < 0 ? tbb::task_arena::automatic : tbb::info::numa_nodes()[domain_];
      arena_ = std::make_unique<tbb::task_arena>(tbb::task_arena::constraints{node, own});
      arena_->initialize();
    } else {
      serial_ = own == 1;
    }
    const int count = arena_    ? arena_->max_concurrency()
                      : serial_ ? 1
                                : std::max(tbb::info::default_concurrency(), tbb::this_task_arena::max_concurrency());
    within([&] {
      scratch_ = std::vector<Scratch>(static_cast<std::size_t>(count));
      for (Scratch& scratch : scratch_) scratch.block = AlignedBlock<std::byte>(scratch_bytes);
    });
  }

  /// As in BatchOptions.
  int threads() const { return threads_; }
  int memory_domain() const { return domain_; }

  /// How many may work at once.
  int concurrency() const {
    return serial_ ? 1 : arena_ ? arena_->max_concurrency() : tbb::this_task_arena::max_concurrency();
  }

  /// Calls act() in the arena of the threads: memory that it touches first is in their memory domain.
  template <class Act>
  void within(const Act& act) const {
    arena_ ? arena_->execute(act) : act();
  }

  /// Calls act(first, last, scratch) for ranges of environments that cover [0, count), in the floating-point mode of a
  /// step. Ranges begin at cache lines, so no two threads write to the same line. One environment takes about
  /// `nanoseconds`. Groups of `group` environments, a power of two, are faster: they are not split if there is one for
  /// each thread.
  template <class Act>
  void for_environments(std::ptrdiff_t count, double nanoseconds, std::ptrdiff_t group, const Act& act) {
    if (serial_) {
      const simd::StepMode mode;
      return act(0, count, scratch_.front().block.data());
    }
    const auto all = [&] {
      const int threads = tbb::this_task_arena::max_concurrency();
      const bool enough = count >= threads * group;
      const std::ptrdiff_t unit = enough ? std::max(per_line, group) : per_line;
      const std::ptrdiff_t units = (count + unit - 1) / unit;
      tbb::parallel_for(
          tbb::blocked_range<std::ptrdiff_t>(0, units,
                                             units_per_task(units, nanoseconds * static_cast<double>(unit), threads)),
          [&](const tbb::blocked_range<std::ptrdiff_t>& range) {
            const simd::StepMode mode;
            Scratch& scratch = free_scratch();
            act(range.begin() * unit, std::min(range.end() * unit, count), scratch.block.data());
            scratch.taken.clear(std::memory_order_release);
          },
          tbb::simple_partitioner());
    };
    within(all);
  }

 private:
  struct alignas(cache_line) Scratch {
    AlignedBlock<std::byte> block;
    std::atomic_flag taken;
  };

  static int checked(int threads) {
    if (threads >= 0 && threads <= most_threads) return threads;
    throw SettingsError("threads", "is " + std::to_string(threads) + ", outside 0 to " + std::to_string(most_threads),
                        "give 0 for all, or a number");
  }

  static int checked_domain(int domain) {
    if (domain == -1) return domain;
    const int count = static_cast<int>(tbb::info::numa_nodes().size());
    if (domain >= 0 && domain < count) return domain;
    throw SettingsError("memory_domain",
                        "is " + std::to_string(domain) + ", and this process sees " + std::to_string(count) +
                            " domain" + (count == 1 ? "" : "s"),
                        "give -1 for any, or 0 to " + std::to_string(count - 1));
  }

  // How many an arena of its own has; 0: that of the caller, in which no more than may be used are at work anyway.
  int own_threads() const {
    if (threads_ > 0) return threads_;
    const int usable = usable_processors();
    if (domain_ < 0) return usable < tbb::this_task_arena::max_concurrency() ? usable : 0;
    return std::min(usable, tbb::info::default_concurrency(tbb::info::numa_nodes()[domain_]));
  }

  // Scratch memory that no other thread uses: the thread's own where it can be, as that is in its cache. A caller's
  // arena may have more threads than the one that the batch was made in; those wait.
  Scratch& free_scratch() {
    const std::size_t own = static_cast<std::size_t>(std::max(0, tbb::this_task_arena::current_thread_index()));
    for (std::size_t i = 0;; ++i) {
      Scratch& scratch = scratch_[(own + i) % scratch_.size()];
      if (!scratch.taken.test_and_set(std::memory_order_acquire)) return scratch;
      if (i % scratch_.size() == scratch_.size() - 1) std::this_thread::yield();
    }
  }

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

  int threads_, domain_;  // as given
  bool serial_ = false;   // in the calling thread
  std::vector<Scratch> scratch_;
  std::unique_ptr<tbb::task_arena> arena_;
};

}  // namespace lockstep
