// Which numbers are connected. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

namespace lockstep {

/// The numbers from 0 to n - 1 in parts, each of which goes by its smallest number.
class Parts {
 public:
  explicit Parts(int n) : before_(static_cast<std::size_t>(n)) { std::iota(before_.begin(), before_.end(), 0); }
  void join(int a, int b) {
    a = of(a), b = of(b);
    at(std::max(a, b)) = std::min(a, b);
  }
  int of(int number) {
    while (at(number) != number) number = at(number) = at(at(number));
    return number;
  }
  /// By number.
  std::vector<int> all() {
    for (int i = 0; i < static_cast<int>(before_.size()); ++i) at(i) = of(i);
    return before_;
  }

 private:
  int& at(int number) { return before_[static_cast<std::size_t>(number)]; }
  std::vector<int> before_;  // another number of the same part, or itself if it is the smallest
};

}  // namespace lockstep
