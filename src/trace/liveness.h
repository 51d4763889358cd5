// What of a graph is wanted. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ir.h"

namespace lockstep::trace {

/// How often each node is used by what reaches memory, directly or through others; 0 for those that nobody wants.
std::vector<int> use_counts(const Graph& graph);

}  // namespace lockstep::trace
