// SPDX-License-Identifier: Apache-2.0
#include "compile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <new>
#include <string_view>

#include "lockstep/error.h"
#include "names.h"
#include "trace/cost.h"

namespace lockstep::jit {
namespace {

// Why this process makes no machine code; empty if it does.
std::string process_obstacle() {
  const char* const variable = std::getenv("LOCKSTEP_COMPILED");
  return variable && std::string_view(variable) == "0" ? "LOCKSTEP_COMPILED is 0 in the environment" : build_obstacle();
}

// AVX2 or AVX-512.
bool has_code(const TilePlaces& places) { return places.fused && (places.bytes == 32 || places.bytes == 64); }

// A loop around code that works on the tile in memory has no machine code yet.
bool has_loop_of_stages(const trace::Graph& graph) {
  return std::any_of(graph.items().begin(), graph.items().end(),
                     [](const trace::Item& item) { return !item.code.empty() && item.call == Call::none; }) ||
         std::any_of(graph.subroutines.begin(), graph.subroutines.end(),
                     [](const auto& subroutine) { return has_loop_of_stages(*subroutine); });
}

// Calls use(). Returns why that failed, empty if it has not: then the tables run, which need nothing of it.
template <class Use>
std::string failure_of(Use use) {
  try {
    use();
    return "";
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const SettingsError& error) {  // a step that solves lane by lane, for instance
    return error.element() + " " + error.rule();
  } catch (const std::exception& error) {
    return error.what();
  }
}

const CompiledSteps& steps_of(const Program& program) {
  return program.compiled.get([&] {
    const auto steps = std::make_shared<CompiledSteps>();
    steps->obstacle = process_obstacle();
    if (steps->obstacle.empty() && trace::cost_of(program).flops > trace::most_traced_flops)
      steps->obstacle = "a step takes more operations than machine code is made for";
    if (!steps->obstacle.empty()) return std::shared_ptr<const CompiledSteps>(steps);
    if (trace::takes_routines(program.f64))
      steps->obstacle = failure_of([&] { steps->routines = trace::trace_routines(program); });
    else
      steps->obstacle = failure_of([&] { steps->traced = trace::trace_step(program, true); });
    if (steps->traced && has_loop_of_stages(steps->traced->any))
      steps->obstacle = "limited servos are repeated in a loop of the tables";
    return std::shared_ptr<const CompiledSteps>(steps);
  });
}

std::vector<NamedCode> named_code(const Program& program, const CompiledStep& step) {
  std::vector<NamedCode> code;
  const auto add = [&](auto function, int bytes, const char* kind) {
    if (function)
      code.push_back(
          {fmt::format("lockstep {} ({})", program.model.name, kind), reinterpret_cast<const void*>(function), bytes});
  };
  add(step.code.any, step.any.bytes, "any tile");
  add(step.code.consistent, step.consistent.bytes, "consistent followers");
  for (int i = 0; i < kernels::routine_count; ++i)
    add(step.code.routine[i], step.routine_bytes[i], kernels::routine_names[i]);
  return code;
}

}  // namespace

const CompiledStep& compiled_step(const Program& program, int scalar_bytes, const TilePlaces& places) {
  const CompiledSteps& steps = steps_of(program);
  const std::lock_guard lock(steps.mutex);
  if (const auto known = steps.by_target.find(places.call); known != steps.by_target.end()) return known->second;
  CompiledStep step;
  std::string obstacle = steps.obstacle;
  if (obstacle.empty() && !has_code(places)) obstacle = "machine code is made for AVX2 and AVX-512 only";
  if (obstacle.empty())
    obstacle = failure_of([&] {
      step = steps.routines ? make(*steps.routines, scalar_bytes, places) : make(*steps.traced, scalar_bytes, places);
    });
  if (!obstacle.empty()) step.obstacle = obstacle;
  if (step.memory) step.names = name_code(named_code(program, step));
  return steps.by_target.emplace(places.call, std::move(step)).first->second;
}

std::string assembly(const Program& program, int scalar_bytes, const TilePlaces& places) {
  const CompiledSteps& steps = steps_of(program);
  if (!steps.obstacle.empty() || !has_code(places)) return "";
  return steps.routines ? print_routines(*steps.routines, scalar_bytes, places)
                        : print_step(*steps.traced, scalar_bytes, places);
}

const std::string& plan_obstacle(const Program& program) { return steps_of(program).obstacle; }

bool has_routines(const Program& program) { return steps_of(program).routines.has_value(); }

const char* speed_obstacle(const Program& program) {
  const Tables<double>& t = program.f64;
  if (trace::takes_routines(t) || trace::traces_bounds(t)) return nullptr;
  if (t.bounds.always && t.velocities > trace::most_velocities_of_scopes)
    return "friction, kinematic drives or force limits call the tables in every step, and it has many velocities";
  if (!program.second_phase_anyway) return "where no bound acts, the tables leave out the velocity phase";
  if (t.rounds.used() && t.integrator == Integrator::leapfrog)  // limits act often
    return "leapfrog takes each step in which a bound acts again by the tables";
  return nullptr;
}

}  // namespace lockstep::jit
