// Which engine steps a batch. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "jit/compile.h"
#include "lockstep/batch.h"
#include "targets/generated_kernel.h"

namespace lockstep {

struct ChosenEngine {
  Engine engine;
  const GeneratedKernel* kernel = nullptr;      ///< of Engine::generated
  const jit::CompiledStep* compiled = nullptr;  ///< of Engine::compiled
};

/// Why the plan has no machine code for the target in precision S; empty if it has.
template <class S>
const std::string& code_obstacle(const Plan& plan, Target target);

/// Throws SettingsError for an engine that does not take the plan.
template <class S>
ChosenEngine choose_engine(const Plan& plan, Target target, Engine wanted);

/// The engine that automatic takes where the program holds no kernel and this one takes the plan; automatic is the
/// library's own choice. Tests run their programs once more by another engine so. Not thread-safe.
void prefer_engine(Engine engine);

}  // namespace lockstep
