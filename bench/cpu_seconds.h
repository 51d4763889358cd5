// The clock of the benchmarks. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

namespace lockstep::bench {

/// Processor time of this thread, in seconds.
inline double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace lockstep::bench
