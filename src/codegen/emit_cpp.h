// A graph as C++. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "split.h"
#include "trace/ir.h"

namespace lockstep::codegen {

using trace::Graph, trace::Id, trace::Item, trace::Node, trace::Op, trace::Place, trace::Write;

struct Emitted {
  std::vector<Block> blocks;  ///< statements of a function that has T, t, batch and x
  std::string code() const;   ///< all blocks
  long operations = 0;        ///< on registers; a multiply-add is one, and a loop counts once
  long flops = 0;             ///< a multiply-add is two, and all turns of a loop count
};

Emitted emit_cpp(const Graph& graph);

}  // namespace lockstep::codegen
