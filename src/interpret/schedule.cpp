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
        joined_(operations_.size(), -1),
        looks_at_lasting_(operations_.size(), false),
        lasting_(lasting) {
    for (const DraftOp& draft : operations_) each_use(draft, [&](Value v) { ++uses_[v]; });
    for (int i = 0; i < count(); ++i) join(i);
  }

  std::vector<DraftOp> in_order() {
    std::vector<char> goes_along(operations_.size(), false);
    for (int maker : joined_)
      if (maker >= 0) goes_along[maker] = true;
    for (int i = 0; i < count(); ++i)
      if (!goes_along[i]) put(i);
    return std::move(ordered_);
  }

 private:
  int count() const { return static_cast<int>(operations_.size()); }

  // What is draft before a stage is called may be changed by it, and what looks at a state is not to be draft after
  // that has become another.
  bool may_move(int maker) const { return maker > called_ && (maker > overwritten_ || !looks_at_lasting_[maker]); }

  // With the one of its numbers that was draft last.
  void join(int i) {
    DraftOp& draft = operations_[i];
    for (int n = 0; n < 3 && is_arithmetic(draft.opcode); ++n) {
      const Value v = draft.from[n];
      if (v < 0) continue;
      if (lasting_.contains(v)) looks_at_lasting_[i] = true;
      if (uses_[v] != 1 || maker_[v] <= joined_[i] || !may_move(maker_[v])) continue;
      joined_[i] = maker_[v];
      draft.last = static_cast<Last>(n + 1);
    }
    if (joined_[i] >= 0 && looks_at_lasting_[joined_[i]]) looks_at_lasting_[i] = true;
    if (draft.last == Last::b && draft.from[0] >= 0 && commutes(draft.opcode)) {
      std::swap(draft.from[0], draft.from[1]);
      draft.last = Last::a;
    }
    if (draft.opcode >= Opcode::write) called_ = i;
    if (lasting_.contains(draft.to))
      overwritten_ = i;
    else if (is_arithmetic(draft.opcode))
      maker_[draft.to] = i;
  }

  void put(int i) {
    if (joined_[i] >= 0) put(joined_[i]);
    ordered_.push_back(std::move(operations_[i]));
  }

  std::vector<DraftOp> operations_, ordered_;
  std::vector<int> uses_, maker_, joined_;  // by value, by value, by operation
  std::vector<char> looks_at_lasting_;      // by operation, with what goes along
  const std::set<Value>& lasting_;
  int called_ = -1, overwritten_ = -1;  // the last operation that calls, or overwrites a state
};

}  // namespace

std::vector<DraftOp> schedule(std::vector<DraftOp> operations, int values, const std::set<Value>& lasting) {
  return Chains(std::move(operations), values, lasting).in_order();
}

}  // namespace lockstep::interpret
