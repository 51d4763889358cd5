// SPDX-License-Identifier: Apache-2.0
#include "engine.h"

#include "lockstep/error.h"
#include "lockstep/generate.h"
#include "plan/program.h"
#include "targets/dispatch.h"
#include "targets/registry.h"

namespace lockstep {
namespace {

Engine preferred = Engine::automatic;

// Null if this program holds none for the plan.
template <class S>
const GeneratedKernel* kernel_for(const Plan& plan, Target target) {
  return registered_kernels() > 0 ? find_kernel<S>(kernel_hash(plan), target) : nullptr;
}

template <class S>
jit::TilePlaces places_of(const Plan& plan, Target target) {
  jit::TilePlaces places;
  kernels_for<S>(target).find_places(tables<S>(program_of(plan)), places);
  return places;
}

template <class S>
const jit::CompiledStep& compiled_for(const Plan& plan, Target target) {
  return jit::compiled_step(program_of(plan), sizeof(S), places_of<S>(plan, target));
}

template <class S>
std::string machine_code_of(const Plan& plan, Target target) {
  if (const std::string& obstacle = code_obstacle<S>(plan, target); !obstacle.empty())
    throw SettingsError("engine", "compiled does not apply: " + obstacle, "use a plan that it takes");
  return jit::assembly(program_of(plan), sizeof(S), places_of<S>(plan, target));
}

}  // namespace

template <class S>
const std::string& code_obstacle(const Plan& plan, Target target) {
  return compiled_for<S>(plan, target).obstacle;
}

void prefer_engine(Engine engine) { preferred = engine; }

const char* to_string(Engine engine) noexcept {
  switch (engine) {
    case Engine::automatic: break;
    case Engine::tables: return "tables";
    case Engine::compiled: return "compiled";
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
  const bool pays = preferred == Engine::automatic ? !jit::speed_obstacle(program) : preferred == Engine::compiled;
  if (wanted == Engine::compiled || (automatic && pays)) {
    const jit::CompiledStep& step = compiled_for<S>(plan, target);
    if (step.memory) return {Engine::compiled, nullptr, &step};
    if (!automatic)
      throw SettingsError("engine", "compiled does not apply: " + step.obstacle, "use the tables or automatic");
  }
  return {Engine::tables};
}

std::string machine_code(const Plan& plan, Target target, int scalar_bytes) {
  target = resolve(target);
  if (scalar_bytes == 4) return machine_code_of<float>(plan, target);
  if (scalar_bytes == 8) return machine_code_of<double>(plan, target);
  throw SettingsError("scalar_bytes", "is neither 4 nor 8", "give the size of float or double");
}

template const std::string& code_obstacle<float>(const Plan&, Target);
template const std::string& code_obstacle<double>(const Plan&, Target);
template ChosenEngine choose_engine<float>(const Plan&, Target, Engine);
template ChosenEngine choose_engine<double>(const Plan&, Target, Engine);

}  // namespace lockstep
