// Operations of a list while it is made, before their numbers have slots. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <set>
#include <vector>

#include "../plan/program.h"
#include "graph.h"

namespace lockstep::generate {

using Value = int;  // a number that an operation makes; later a slot, which values share one after the other

struct Touch {  // of memory
  Place place;
  Value value;
};

struct Made {
  Does does = Does::copy;
  Value to = -1, also_to = -1;                 // also_to: the cosine
  std::array<Value, 3> from{-1, -1, -1};
  int constant = -1;
  Call call = Call::none;
  std::vector<Touch> writes = {}, reads = {};  // of a call under a condition; of a read or a write there is one
  Last last = Last::none;                      // which of `from` is made right before and has no slot
};

/// For each number that an operation uses, once for each time.
template <class Use>
void used_by(const Made& made, Use use) {
  for (Value v : made.from)
    if (v >= 0) use(v);
  for (const Touch& touch : made.writes) use(touch.value);
  for (const Touch& touch : made.reads) use(touch.value);
}

/// A list while it is made.
struct MadeList {
  std::vector<Made> constants_first;
  std::vector<Touch> before;
  std::vector<Made> operations;
  std::vector<Touch> after;
  std::vector<double> constants;
  int values;  // one more than the highest
  bool apart;
};

/// The same operations, each right behind one that makes a number for it alone, where there is such a one: that number
/// need not be stored. `values` is one more than the highest; those that are `lasting` are wanted by others too.
std::vector<Made> in_chains(std::vector<Made> operations, int values, const std::set<Value>& lasting);

/// Gives values slots, the same one to several that are wanted one after the other, and writes the list down. Throws
/// std::length_error where it is longer than its numbers allow.
OperationList in_slots(const MadeList& made, lockstep::Store& store);

}  // namespace lockstep::generate
