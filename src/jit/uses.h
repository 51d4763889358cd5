// When the operations of a listing use its values. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <vector>

#include "operations.h"

namespace lockstep::jit {

/// The uses of each value, and the operation that the allocation has come to. A use in a rare part counts as much later
/// than it is. What a turn of a loop needs from before the loop is used once more where the loop ends.
class Uses {
 public:
  static constexpr int never = std::numeric_limits<int>::max();

  explicit Uses(const Listing& listing);

  void come_to(int operation) { now_ = operation; }
  int now() const { return now_; }

  bool exist(Value v) const { return !uses_[v].empty(); }
  bool are_left(Value v) const { return next_[v] < uses_[v].size(); }
  bool are_left_behind(Value v) const { return are_left(v) && uses_[v].back().at > now_; }
  bool is_used_now(Value v) const { return are_left(v) && uses_[v][next_[v]].at == now_; }
  /// The operation of the next use, this one included; never if there is none.
  int next(Value v) const;
  /// The same without this one.
  int next_behind(Value v) const;
  /// This operation has used the value.
  void take(Value v) {
    if (is_used_now(v)) ++next_[v];
  }

 private:
  struct Use {
    int at;
    bool rare;
  };

  std::vector<std::vector<Use>> uses_;  // by value
  std::vector<std::size_t> next_;       // by value: its next use
  int now_ = 0;
};

}  // namespace lockstep::jit
