// Operations of a list while it is draft, before their numbers have slots. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <set>
#include <vector>

#include "operations.h"
#include "plan/program.h"
#include "trace/ir.h"

namespace lockstep::interpret {

using trace::Graph, trace::Id, trace::Item, trace::Node, trace::Op, trace::Place, trace::Write;

using Value = int;  // a number that an operation makes; later a slot, which values share one after the other

struct MemoryAccess {  // of memory
  Place place;
  Value value;
};

struct DraftOp {
  Opcode opcode = Opcode::copy;
  Value to = -1, also_to = -1;  // also_to: the cosine
  std::array<Value, 3> from{-1, -1, -1};
  int constant = -1;
  Call call = Call::none;
  std::vector<MemoryAccess> writes = {}, reads = {};  // of a call under a condition; of a read or a write there is one
  Last last = Last::none;                             // which of `from` is draft right before and has no slot
};

/// For each number that an operation uses, once for each time.
template <class Use>
void each_use(const DraftOp& draft, Use use) {
  for (Value v : draft.from)
    if (v >= 0) use(v);
  for (const MemoryAccess& access : draft.writes) use(access.value);
  for (const MemoryAccess& access : draft.reads) use(access.value);
}

/// A list while it is draft.
struct DraftList {
  std::vector<DraftOp> constants_first;
  std::vector<MemoryAccess> before;
  std::vector<DraftOp> operations;
  std::vector<MemoryAccess> after;
  std::vector<double> constants;
  int values;  // one more than the highest
  bool apart;
};

/// The same operations, each right behind one that makes a number for it alone, where there is such a one: that number
/// need not be stored. `values` is one more than the highest; those that are `lasting` are wanted by others too.
std::vector<DraftOp> schedule(std::vector<DraftOp> operations, int values, const std::set<Value>& lasting);

/// Gives values slots, the same one to several that are wanted one after the other, and writes the list down. Throws
/// std::length_error where it is longer than its numbers allow.
OperationList allocate_slots(const DraftList& draft, TableStorage& store);

}  // namespace lockstep::interpret
