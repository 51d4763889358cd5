// The draft of a list: operations whose numbers have no slots yet. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <set>
#include <vector>

#include "operations.h"
#include "plan/program.h"
#include "trace/ir.h"

namespace lockstep::interpret {

using trace::Graph, trace::Id, trace::Item, trace::Node, trace::Op, trace::Place, trace::Write;

using Value = int;  // a number that an operation makes; allocation gives it a slot

struct MemoryAccess {  // a read or a write
  Place place;
  Value value;
};

struct DraftOp {
  Opcode opcode = Opcode::copy;
  Value to = -1, also_to = -1;  // also_to: the cosine
  std::array<Value, 3> from{-1, -1, -1};
  int constant = -1;
  Call call = Call::none;
  std::vector<MemoryAccess> writes = {}, reads = {};  // several for call_if, one for read or write
  Last last = Last::none;  // which of `from` is the previous operation's result, without slot
};

/// use(value) for each use of a value by the operation.
template <class Use>
void each_use(const DraftOp& draft, Use use) {
  for (Value v : draft.from)
    if (v >= 0) use(v);
  for (const MemoryAccess& access : draft.writes) use(access.value);
  for (const MemoryAccess& access : draft.reads) use(access.value);
}

/// The draft of an OperationList, whose fields have the same names.
struct DraftList {
  std::vector<DraftOp> constants_first;
  std::vector<MemoryAccess> before;
  std::vector<DraftOp> operations;
  std::vector<MemoryAccess> after;
  std::vector<double> constants;
  int values;  // how many there are
  bool apart;
};

/// Reorders operations. Where possible, each follows an operation whose result it alone uses, so that this result needs
/// no slot. There are `values` values; those that are `lasting` are also used outside of the step.
std::vector<DraftOp> schedule(std::vector<DraftOp> operations, int values, const std::set<Value>& lasting);

/// Gives each value a slot and encodes the list. Values share a slot if their lifetimes do not overlap. Throws
/// std::length_error if an index does not fit into an Operation.
OperationList allocate_slots(const DraftList& draft, TableStorage& storage);

}  // namespace lockstep::interpret
