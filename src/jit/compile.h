// The step of a plan as machine code. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "frame.h"
#include "memory.h"
#include "plan/program.h"
#include "trace/trace.h"

namespace lockstep {

namespace jit {

/// What the code of one function is like.
struct CodeSize {
  int operations = 0, instructions = 0, bytes = 0, parts = 1, slots = 0, spills = 0, reloads = 0;
};

struct CompiledStep {
  StepCode code;  ///< code.any is null if there is none
  CodeSize any, consistent;
  std::string obstacle;  ///< why there is no code
  std::vector<Access> rows;
  CodeMemory memory;
};

}  // namespace jit

/// The machine code of a plan so far.
struct CompiledSteps {
  std::optional<trace::TracedStep> traced;
  std::string obstacle;  ///< why there is no trace
  mutable std::mutex mutex;
  mutable std::map<jit::CallStage, jit::CompiledStep> by_target;
};

namespace jit {

/// The step for the kernels that `places` describes. Made on the first call, which takes
/// milliseconds; kept with the plan and its copies. Thread-safe. The environment variable LOCKSTEP_COMPILED=0 forbids
/// it.
const CompiledStep& compiled_step(const Program& program, int scalar_bytes, const TilePlaces& places);

/// The instructions of the step of any tile, each beside the name of the number that it makes. Empty if there is none.
std::string assembly(const Program& program, int scalar_bytes, const TilePlaces& places);

/// Why no target has code for the plan in this process; empty if some may.
const std::string& plan_obstacle(const Program& program);

/// Why the tables are faster, null if the code is. This does not depend on inactive bounds, which may not change the
/// result by a bit.
const char* speed_obstacle(const Program& program);

}  // namespace jit
}  // namespace lockstep
