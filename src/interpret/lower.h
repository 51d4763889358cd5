// A graph as a list of operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "operations.h"
#include "plan/program.h"

namespace lockstep {

/// The step of one plan as lists of operations.
struct InterpretedStep {
  OperationList any;         ///< for any tile; empty if the plan has no list
  OperationList consistent;  ///< the shorter list for tiles of consistent followers; empty if there is none
  TableStorage storage;
};

}  // namespace lockstep

namespace lockstep::interpret {

/// The plan's step as a list, made on the first call. Null if the list would be too long, if a step solves lane by
/// lane, or if it iterates over limited servos. Thread-safe.
const OperationList* interpreted_step(const Program& program);

/// Whether the interpreter is faster than the tables' loops. This does not depend on inactive bounds, which may not
/// change the result by a bit.
bool interpreter_pays(const Program& program);

}  // namespace lockstep::interpret
