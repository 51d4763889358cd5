// Which nodes of a graph are used. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ir.h"

namespace lockstep::trace {

/// By node, its use count: uses by stores, and by nodes that a store depends on.
std::vector<int> use_counts(const Graph& graph);

/// Leaves out what subroutines change and nobody reads, and arguments that they do not read.
void drop_unread_results(Graph& graph);

}  // namespace lockstep::trace
