// Catches two threads in one batch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "lockstep/error.h"

namespace lockstep {

/// Holds the flag of a batch for as long as it lives, unless somebody else holds it.
class InUse {
 public:
  explicit InUse(std::atomic<bool>& flag) noexcept
      : flag_(flag), alone_(!flag.exchange(true, std::memory_order_acquire)) {}
  ~InUse() {
    if (alone_) flag_.store(false, std::memory_order_release);
  }
  InUse(const InUse&) = delete;
  InUse& operator=(const InUse&) = delete;

  bool alone() const noexcept { return alone_; }

 private:
  std::atomic<bool>& flag_;
  bool alone_;
};

/// Throws where somebody else holds the flag.
struct Alone : InUse {
  explicit Alone(std::atomic<bool>& flag) : InUse(flag) {
    if (!alone())
      throw UsageError("batch", "is in use: the functions of one Batch must not run at the same time",
                       "wait for the other thread, or give each a batch of its own");
  }
};

}  // namespace lockstep
