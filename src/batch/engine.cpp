// SPDX-License-Identifier: Apache-2.0
#include "engine.h"

#include "interpret/lower.h"
#include "lockstep/error.h"
#include "lockstep/generate.h"
#include "plan/program.h"
#include "targets/registry.h"

namespace lockstep {
namespace {

Engine preferred = Engine::automatic;

// Null if this program holds none for the plan.
template <class S>
const GeneratedKernel* kernel_for(const Plan& plan, Target target) {
  return any_kernel_registered() ? find_kernel<S>(kernel_hash(plan), target) : nullptr;
}

}  // namespace

void prefer_engine(Engine engine) { preferred = engine; }

const char* to_string(Engine engine) noexcept {
  switch (engine) {
    case Engine::automatic: break;
    case Engine::tables: return "tables";
    case Engine::interpreter: return "interpreter";
    case Engine::generated: return "generated";
  }
  return "automatic";
}

template <class S>
ChosenEngine choose_engine(const Plan& plan, Target target, Engine wanted) {
  if (wanted < Engine::automatic || wanted > Engine::generated)
    throw SettingsError("engine " + std::to_string(static_cast<int>(wanted)), "is none of the enumerators",
                        "give one of Engine");
  const Program& program = program_of(plan);
  const bool automatic = wanted == Engine::automatic;
  if (automatic || wanted == Engine::generated) {
    if (const GeneratedKernel* kernel = kernel_for<S>(plan, target)) return {Engine::generated, kernel};
    if (!automatic)
      throw SettingsError("engine",
                          "generated does not apply: this program holds no kernel for the plan, the target and "
                          "the precision",
                          "add one by lockstep_add_kernel() of CMake, or use another engine");
  }
  const bool pays =
      preferred == Engine::automatic ? interpret::interpreter_pays(program) : preferred == Engine::interpreter;
  if (wanted == Engine::interpreter || (automatic && pays)) {
    if (const OperationList* operations = interpret::interpreted_step(program))
      return {Engine::interpreter, nullptr, operations};
    if (!automatic)
      throw SettingsError("engine", "interpreter does not apply: " + interpret::list_obstacle(program),
                          "use the tables or automatic");
  }
  return {Engine::tables};
}

template ChosenEngine choose_engine<float>(const Plan&, Target, Engine);
template ChosenEngine choose_engine<double>(const Plan&, Target, Engine);

}  // namespace lockstep
