// A graph as a list of operations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "operations.h"
#include "plan/program.h"

namespace lockstep {

/// The step of one plan as lists of operations.
struct InterpretedStep {
  OperationList any;         ///< for any tile; empty if the plan has no list
  OperationList consistent;  ///< the shorter list for tiles of consistent followers; empty if there is none
  TableStorage storage;
  std::string obstacle;  ///< why there is no list
};

}  // namespace lockstep

namespace lockstep::interpret {

/// The plan's step as a list, made on the first call. Null if the interpreter cannot run it. Thread-safe.
const OperationList* interpreted_step(const Program& program);

/// Why interpreted_step() is null; empty if it is not.
const std::string& list_obstacle(const Program& program);

/// Why the interpreter is not faster than the tables' loops, null if it is. This does not depend on inactive bounds,
/// which may not change the result by a bit.
const char* speed_obstacle(const Program& program);
inline bool interpreter_pays(const Program& program) { return !speed_obstacle(program); }

}  // namespace lockstep::interpret
