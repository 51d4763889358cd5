// Operations of a list while it is made, before their numbers have slots. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "../plan/operations.h"
#include "graph.h"

namespace lockstep::generate {

using Value = int;  // a number that an operation makes; later a slot, which values share one after the other

struct Touch {  // of memory
  Place place;
  Value value;
};

struct Sources : std::array<Value, 5> {
  Sources(Value a = -1, Value b = -1, Value c = -1, Value d = -1, Value e = -1) : array{a, b, c, d, e} {}
};

struct Made {
  Does does = Does::copy;
  Value to = -1, also_to = -1;           // also_to: the cosine
  Sources from = {};
  int constant = -1;
  Call call = Call::none;
  std::vector<Touch> writes = {}, reads = {};  // of a call under a condition; of a read or a write there is one
};

/// Moves `pending` behind `ordered`, equal operations next to each other where their operands allow it. `values` is one
/// more than the highest value.
void move_in_order(std::vector<Made>& pending, int values, std::vector<Made>& ordered);

}  // namespace lockstep::generate
