// Orders a list so that results are used right after they are made. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "draft.h"

namespace lockstep::interpret {
namespace {

class Chains {
 public:
  Chains(std::vector<DraftOp> operations, int values, const std::set<Value>& lasting)
      : operations_(std::move(operations)),
        uses_(static_cast<std::size_t>(values)),
        maker_(static_cast<std::size_t>(values), -1),
        previous_(operations_.size(), -1),
        reads_lasting_(operations_.size(), false),
        lasting_(lasting) {
    for (const DraftOp& draft : operations_) each_use(draft, [&](Value v) { ++uses_[v]; });
    for (int i = 0; i < count(); ++i) chain(i);
  }

  std::vector<DraftOp> ordered() {
    std::vector<char> is_previous(operations_.size(), false);
    for (int maker : previous_)
      if (maker >= 0) is_previous[maker] = true;
    for (int i = 0; i < count(); ++i)
      if (!is_previous[i]) put(i);
    return std::move(ordered_);
  }

 private:
  int count() const { return static_cast<int>(operations_.size()); }

  // An operation may not move past a call, which may change memory. One that reads a lasting value may not move past an
  // operation that overwrites such a value.
  bool may_move(int maker) const { return maker > last_call_ && (maker > last_overwrite_ || !reads_lasting_[maker]); }

  // Chains operation i to the one that makes an operand for it alone, the last of these if there are several.
  void chain(int i) {
    DraftOp& draft = operations_[i];
    for (int n = 0; n < 3 && is_arithmetic(draft.opcode); ++n) {
      const Value v = draft.from[n];
      if (v < 0) continue;
      if (lasting_.contains(v)) reads_lasting_[i] = true;
      if (uses_[v] != 1 || maker_[v] <= previous_[i] || !may_move(maker_[v])) continue;
      previous_[i] = maker_[v];
      draft.last = static_cast<Last>(n + 1);
    }
    if (previous_[i] >= 0 && reads_lasting_[previous_[i]]) reads_lasting_[i] = true;
    if (draft.last == Last::b && draft.from[0] >= 0 && commutes(draft.opcode)) {
      std::swap(draft.from[0], draft.from[1]);
      draft.last = Last::a;
    }
    if (draft.opcode >= Opcode::write) last_call_ = i;
    if (lasting_.contains(draft.to))
      last_overwrite_ = i;
    else if (is_arithmetic(draft.opcode))
      maker_[draft.to] = i;
  }

  void put(int i) {
    if (previous_[i] >= 0) put(previous_[i]);
    ordered_.push_back(std::move(operations_[i]));
  }

  std::vector<DraftOp> operations_, ordered_;
  std::vector<int> uses_, maker_, previous_;  // by value, by value, by operation: the one that it is chained to
  std::vector<char> reads_lasting_;           // by operation, including those chained before it
  const std::set<Value>& lasting_;
  int last_call_ = -1, last_overwrite_ = -1;  // operations
};

}  // namespace

std::vector<DraftOp> schedule(std::vector<DraftOp> operations, int values, const std::set<Value>& lasting) {
  return Chains(std::move(operations), values, lasting).ordered();
}

}  // namespace lockstep::interpret
