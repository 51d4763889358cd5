// The threads that a step uses. SPDX-License-Identifier: Apache-2.0
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <ctime>

#include "contract.h"

namespace lockstep {
namespace {

double seconds(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// CPU time of all other threads divided by that of this one.
template <class Act>
double share_of_others(Act act) {
  const double process = seconds(CLOCK_PROCESS_CPUTIME_ID), thread = seconds(CLOCK_THREAD_CPUTIME_ID);
  act();
  const double own = seconds(CLOCK_THREAD_CPUTIME_ID) - thread;
  return (seconds(CLOCK_PROCESS_CPUTIME_ID) - process) / own - 1.0;
}

TEST(Threads, are_taken_from_the_callers_arena_only) {
  const Plan plan = compile(scenes::chain8());
  Batch<float> batch(plan, 16384, {.threads = 0});
  tbb::task_arena one(1);
  EXPECT_LT(share_of_others([&] { one.execute([&] { batch.step(64); }); }), 0.2);
}

// The batch has memory for fewer threads than the arena that steps it.
TEST(Threads, of_a_larger_arena_share_the_memory_of_the_batch) {
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, 16);
  const Plan plan = compile(scenes::chain8());
  auto batch = contract::scattered<float>(plan, 4096, {.threads = 0}),
       serial = contract::scattered<float>(plan, 4096, {.threads = 1});
  tbb::task_arena large(16);
  for (int i = 0; i < 20; ++i) large.execute([&] { batch.step(4); });
  serial.step(80);
  EXPECT_TRUE(contract::same_bits(batch, serial));
}

// With these sizes, ranges of environments end within a tile, a cache line or a task. The tiles of baseline are shorter
// than a cache line.
TEST(Threads, leave_no_environment_out_in_batches_of_odd_sizes) {
  const Plan plan = compile(scenes::chain8());
  const auto largest = contract::scattered<float>(plan, 2100);
  auto once = contract::scattered<float>(plan, 2100, {.threads = 1, .target = Target::baseline});
  once.step(40);
  for (int environments : {1, 15, 16, 17, 31, 33, 63, 65, 527, 1025, 2063}) {
    auto batch = contract::scattered<float>(plan, environments, {.threads = 3, .target = Target::baseline});
    batch.step(40);  // with so many substeps, each cache line is a task
    EXPECT_TRUE(contract::same_bits(batch, once)) << environments << " environments";
    EXPECT_FALSE(contract::same_bits(batch, largest));
  }
}

}  // namespace
}  // namespace lockstep
