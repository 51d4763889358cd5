// In place of oneTBB where the thread sanitizer looks: plain threads. SPDX-License-Identifier: Apache-2.0
//
// Debian's oneTBB is not compiled for the sanitizer, which therefore does not see that one task waits for another, and
// takes all that they share for races. It sees std::thread. This has what src/batch/workers.h and the tests use.
#pragma once

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace tbb {

namespace by_threads {
inline thread_local int concurrency = 0;  // of the arena that runs; 0: outside of arenas
inline thread_local int index = 0;        // of this thread in it
inline std::atomic<int> allowed{1 << 20};
}  // namespace by_threads

struct constraints {
  int numa_id = -1, max_concurrency = -1;
};

namespace info {
inline int default_concurrency() { return std::max(2, static_cast<int>(std::thread::hardware_concurrency())); }
inline int default_concurrency(int) { return default_concurrency(); }
inline std::vector<int> numa_nodes() { return {-1}; }
}  // namespace info

namespace this_task_arena {
inline int max_concurrency() {
  return by_threads::concurrency > 0 ? by_threads::concurrency
                                     : std::min(info::default_concurrency(), by_threads::allowed.load());
}
inline int current_thread_index() { return by_threads::index; }
}  // namespace this_task_arena

class task_arena {
 public:
  using constraints = tbb::constraints;
  static constexpr int automatic = -1;
  explicit task_arena(int threads) : threads_(threads) {}
  explicit task_arena(constraints own) : threads_(own.max_concurrency) {}
  void initialize() {}
  int max_concurrency() const { return threads_; }
  template <class Function>
  void execute(const Function& function) {
    const int before = by_threads::concurrency;
    by_threads::concurrency = threads_;
    function();
    by_threads::concurrency = before;
  }

 private:
  int threads_;
};

class global_control {
 public:
  enum parameter { max_allowed_parallelism };
  global_control(parameter, std::size_t value) { by_threads::allowed = static_cast<int>(value); }
  ~global_control() { by_threads::allowed = 1 << 20; }
};

template <class Value>
class blocked_range {
 public:
  blocked_range(Value begin, Value end, Value grain) : begin_(begin), end_(end), grain_(grain) {}
  Value begin() const { return begin_; }
  Value end() const { return end_; }
  Value grain() const { return grain_; }

 private:
  Value begin_, end_, grain_;
};

struct simple_partitioner {};

// Each thread takes the next part until there is none.
template <class Value, class Body>
void parallel_for(const blocked_range<Value>& range, const Body& body, simple_partitioner) {
  std::atomic<Value> next{range.begin()};
  const int threads = this_task_arena::max_concurrency();
  const auto work = [&](int index) {
    by_threads::concurrency = threads, by_threads::index = index;
    for (Value first = next.fetch_add(range.grain()); first < range.end(); first = next.fetch_add(range.grain()))
      body({first, std::min(first + range.grain(), range.end()), range.grain()});
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work, i);
  const int own_concurrency = by_threads::concurrency, own_index = by_threads::index;
  work(0);
  by_threads::concurrency = own_concurrency, by_threads::index = own_index;
  for (std::thread& other : others) other.join();
}

}  // namespace tbb
