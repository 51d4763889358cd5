// A graph as a list of operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "frame.h"
#include "machine.h"
#include "operations.h"
#include "trace/ir.h"

namespace lockstep::jit {

/// Operations in the order of the graph; a node that is used once is computed where it is used. The rows of the batch
/// that it reads come behind `rows`, those of another graph of the step.
Listing lower(const trace::Graph& graph, const TilePlaces& places, const Machine& machine,
              const std::vector<Access>& rows = {});

}  // namespace lockstep::jit
