// A graph as C++. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "split.h"
#include "trace/ir.h"

namespace lockstep::codegen {

using trace::Graph, trace::Id, trace::Item, trace::Node, trace::Op, trace::Place, trace::Write;

struct Emitted {
  std::vector<Block> blocks;  ///< statements of a function that has T, t, lanes and x
  std::string code() const;   ///< all of them
  long operations = 0;        ///< arithmetic on registers, a multiply-add is one; of one pass through each loop
  long flops = 0;             ///< of all turns of loops; a multiply-add is two
};

Emitted emit_cpp(const Graph& graph);

}  // namespace lockstep::codegen
