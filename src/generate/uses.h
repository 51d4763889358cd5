// What of a graph is wanted. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "graph.h"

namespace lockstep::generate {

/// How often each node is used by what reaches memory, directly or through others; 0 for those that nobody wants.
std::vector<int> uses(const Graph& graph);

}  // namespace lockstep::generate
