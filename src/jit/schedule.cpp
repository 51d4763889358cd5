// SPDX-License-Identifier: Apache-2.0
#include "schedule.h"

#include <algorithm>
#include <list>

namespace lockstep::jit {
namespace {

constexpr int at_once = 3;  // operations a cycle

int latency(Op op) { return op == Op::divide || op == Op::sqrt ? 12 : 4; }

class Scheduling {
 public:
  Scheduling(Listing& listing, int window)
      : listing_(listing), window_(window), known_(listing.home.size(), 0), waits_(listing.home.size(), false) {}

  void run() {
    std::vector<Operation> operations = std::move(listing_.operations);
    std::list<Operation> straight;
    for (Operation& operation : operations) {
      if (has_result(operation.op)) {
        straight.push_back(operation);
        continue;
      }
      put_all(straight);
      ordered_.push_back(operation);
    }
    put_all(straight);
    listing_.operations = std::move(ordered_);
  }

 private:
  void put_all(std::list<Operation>& straight) {
    for (const Operation& operation : straight) waits_[operation.to] = true;
    while (!straight.empty()) {
      auto best = straight.end();
      int soonest = 0, looked_at = 0;
      for (auto o = straight.begin(); o != straight.end() && looked_at < window_; ++o, ++looked_at) {
        const int ready = ready_at(*o);
        if (ready < 0 || (best != straight.end() && ready >= soonest)) continue;
        best = o, soonest = ready;
        if (ready <= cycle_) break;
      }
      if (soonest > cycle_) cycle_ = soonest, issued_ = 0;
      known_[best->to] = cycle_ + latency(best->op);
      waits_[best->to] = false;
      ordered_.push_back(*best);
      straight.erase(best);
      if (++issued_ == at_once) ++cycle_, issued_ = 0;
    }
  }

  // The cycle in which all operands are known, -1 if one is still to be computed.
  int ready_at(const Operation& operation) const {
    int ready = 0;
    for (Value v : operation.from) {
      if (v < 0) continue;
      if (waits_[v]) return -1;
      ready = std::max(ready, known_[v]);
    }
    return ready;
  }

  Listing& listing_;
  int window_;
  std::vector<int> known_;   // by value: the cycle from which it is known
  std::vector<char> waits_;  // by value: its operation is still to be put
  std::vector<Operation> ordered_;
  int cycle_ = 0, issued_ = 0;
};

}  // namespace

void schedule(Listing& listing, int window) {
  if (window > 1) Scheduling(listing, window).run();
}

}  // namespace lockstep::jit
