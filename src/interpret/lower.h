// A graph as a list of operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "operations.h"
#include "plan/program.h"

namespace lockstep {

/// The step of one plan as lists of operations.
struct InterpretedStep {
  OperationList any;         ///< of any tile; no operations where there is no such list
  OperationList consistent;  ///< the shorter one of tiles whose followers are all consistent, if there is one
  TableStorage storage;
};

}  // namespace lockstep

namespace lockstep::interpret {

/// The plan's step as a list, draft when first asked for; null where it would be too long, or where a step solves lane
/// by lane or until it is satisfied. Thread-safe.
const OperationList* interpreted_step(const Program& program);

/// Whether that is faster than the tables' loops. Bounds that are idle have no say in it, so that they change no bit.
bool interpreter_pays(const Program& program);

}  // namespace lockstep::interpret
