// A graph as C++. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "graph.h"
#include "parts.h"

namespace lockstep::generate {

struct Written {
  std::vector<Block> blocks;  ///< statements of a function that has T, t, lanes and x
  std::string code() const;   ///< all of them
  long operations = 0;  ///< arithmetic on registers, a multiply-add is one; of one pass through each loop
  long flops = 0;       ///< of all turns of loops; a multiply-add is two
};

Written write(const Graph& graph);

}  // namespace lockstep::generate
