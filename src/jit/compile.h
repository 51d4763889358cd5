// The step of a plan as machine code, kept with the plan. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "make.h"
#include "plan/program.h"

namespace lockstep {

/// The machine code of a plan so far.
struct CompiledSteps {
  std::optional<trace::TracedStep> traced;
  std::optional<trace::TracedRoutines> routines;  ///< where the step as a whole cannot be traced
  std::string obstacle;                           ///< why there is neither
  mutable std::mutex mutex;
  mutable std::map<jit::CallStage, jit::CompiledStep> by_target;
};

namespace jit {

/// The step for the kernels that `places` describes. Made on the first call, which takes milliseconds; kept with the
/// plan and its copies. A step that cannot be made has the reason in place of code. Thread-safe. The environment
/// variable LOCKSTEP_COMPILED=0 forbids it.
const CompiledStep& compiled_step(const Program& program, int scalar_bytes, const TilePlaces& places);

/// Instructions for people, as print_step(). Empty if there are none.
std::string assembly(const Program& program, int scalar_bytes, const TilePlaces& places);

/// Why no target has code for the plan in this process; empty if some may.
const std::string& plan_obstacle(const Program& program);

/// Whether the tables take the steps of the plan, with routines in machine code.
bool has_routines(const Program& program);

/// Why the tables are faster, null if the code is. This does not depend on inactive bounds, which may not change the
/// result by a bit.
const char* speed_obstacle(const Program& program);

}  // namespace jit
}  // namespace lockstep
