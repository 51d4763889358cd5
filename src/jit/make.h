// From a traced step to machine code in memory. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frame.h"
#include "trace/trace.h"

namespace lockstep::jit {

/// What the code of one function is like.
struct CodeSize {
  int operations = 0, bytes = 0, parts = 1;
};

struct CompiledStep {
  StepCode code;  ///< of the step or of its routines; none without `memory`
  CodeSize any, consistent;
  int routine_bytes[kernels::routine_count] = {};
  std::string obstacle;  ///< why there is no code
  std::vector<Access> rows, unread;
  std::shared_ptr<const void> memory;  ///< holds the code
  std::shared_ptr<const void> names;   ///< tells a debugger what it is called, null if none asks
};

/// Why this library makes no machine code; empty if it does. One that was built without an assembler does not
/// (no_assembler.cpp).
std::string build_obstacle();

/// The code of the step for the kernels that `places` describes. If the system refuses memory for it, the step has the
/// reason in place of code. Throws an exception of the standard library, or Error, if the step cannot be compiled.
CompiledStep make(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places);

/// The same for routines of a step that the tables take.
CompiledStep make(const trace::TracedRoutines& traced, int scalar_bytes, const TilePlaces& places);

/// The instructions of the step of any tile, each beside the name of the number that it makes.
std::string print_step(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places);
std::string print_routines(const trace::TracedRoutines& traced, int scalar_bytes, const TilePlaces& places);

}  // namespace lockstep::jit
