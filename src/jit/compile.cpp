// SPDX-License-Identifier: Apache-2.0
#include "compile.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string_view>

#include "allocate.h"
#include "encode.h"
#include "lockstep/error.h"
#include "lower.h"
#include "print.h"
#include "schedule.h"
#include "trace/cost.h"

namespace lockstep::jit {
namespace {

// Why this process makes no machine code; empty if it does.
std::string process_obstacle() {
#if defined(LOCKSTEP_HAS_ASSEMBLER) && defined(__x86_64__)
  const char* const variable = std::getenv("LOCKSTEP_COMPILED");
  return variable && std::string_view(variable) == "0" ? "LOCKSTEP_COMPILED is 0 in the environment" : "";
#else
  return "this library was built without its assembler";
#endif
}

// A loop around code that works on the tile in memory has no machine code yet.
bool has_loop_of_stages(const trace::Graph& graph) {
  return std::any_of(graph.items().begin(), graph.items().end(),
                     [](const trace::Item& item) { return !item.code.empty() && item.call == Call::none; });
}

const CompiledSteps& steps_of(const Program& program) {
  return program.compiled.get([&] {
    const auto steps = std::make_shared<CompiledSteps>();
    steps->obstacle = process_obstacle();
    if (steps->obstacle.empty() && trace::cost_of(program).flops > trace::most_traced_flops)
      steps->obstacle = "a step takes more operations than machine code is made for";
    if (!steps->obstacle.empty()) return std::shared_ptr<const CompiledSteps>(steps);
    try {
      steps->traced = trace::trace_step(program, true);
      if (has_loop_of_stages(steps->traced->any))
        steps->obstacle = "limited servos are repeated in a loop of the tables";
    } catch (const SettingsError& error) {  // contacts, or a step that solves lane by lane
      steps->obstacle = error.element() + " " + error.rule();
    }
    return std::shared_ptr<const CompiledSteps>(steps);
  });
}

// AVX2 or AVX-512.
bool has_code(const TilePlaces& places) { return places.fused && (places.bytes == 32 || places.bytes == 64); }

Machine machine_of(int scalar_bytes, const TilePlaces& places) { return machine_for(places.bytes == 64, scalar_bytes); }

#if defined(LOCKSTEP_HAS_ASSEMBLER) && defined(__x86_64__)

// Appends the code of a listing to the bytes, and returns where it begins.
std::size_t append(Listing& listing, const TilePlaces& places, const Machine& machine, CodeSize& size, StepCode& code,
                   std::vector<std::uint8_t>& bytes) {
  schedule(listing, machine.window);
  const Allocated allocated = allocate(listing, machine);
  const std::vector<std::uint8_t> encoded = encode(allocated, listing.constants, machine, places.call);
  size = {static_cast<int>(listing.operations.size()),
          static_cast<int>(allocated.instructions.size()),
          static_cast<int>(encoded.size()),
          allocated.parts,
          allocated.slots,
          allocated.spills,
          allocated.reloads};
  code.slots = std::max(code.slots, allocated.slots);
  if (allocated.parts > 1) code.tiles = machine.tiles;
  bytes.resize((bytes.size() + 63) / 64 * 64);
  const std::size_t begin = bytes.size();
  bytes.insert(bytes.end(), encoded.begin(), encoded.end());
  return begin;
}

void make(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places, CompiledStep& step) {
  const Machine machine = machine_of(scalar_bytes, places);
  Listing consistent;
  if (traced.consistent) consistent = lower(*traced.consistent, places, machine);
  Listing any = lower(traced.any, places, machine, consistent.rows);
  step.rows = consistent.rows = any.rows;  // both read the same slots
  std::vector<std::uint8_t> bytes;
  const std::size_t begin_any = append(any, places, machine, step.any, step.code, bytes);
  std::size_t begin_consistent = 0;
  if (traced.consistent) begin_consistent = append(consistent, places, machine, step.consistent, step.code, bytes);
  step.memory = CodeMemory(bytes);
  if (!step.memory.start()) {
    step.obstacle = step.memory.refusal();
    return;
  }
  const auto function = [&](std::size_t begin) {
    return reinterpret_cast<StepCode::Function>(reinterpret_cast<std::uintptr_t>(step.memory.start()) + begin);
  };
  step.code.any = function(begin_any);
  if (traced.consistent) step.code.consistent = function(begin_consistent);
  step.code.rows = {step.rows.data(), static_cast<int>(step.rows.size())};
}

// Tells profilers the names of the functions, if LOCKSTEP_PERF is set: perf reads such files.
void name_functions(const Program& program, const CompiledStep& step) {
  if (!std::getenv("LOCKSTEP_PERF")) return;
  std::ofstream map(fmt::format("/tmp/perf-{}.map", getpid()), std::ios::app);
  const auto add = [&](StepCode::Function function, int bytes, const char* kind) {
    if (function)
      map << fmt::format("{:x} {:x} lockstep {} ({})\n", reinterpret_cast<std::uintptr_t>(function), bytes,
                         program.model.name, kind);
  };
  add(step.code.any, step.any.bytes, "any tile");
  add(step.code.consistent, step.consistent.bytes, "consistent followers");
}

#endif

}  // namespace

std::string assembly(const Program& program, int scalar_bytes, const TilePlaces& places) {
  const CompiledSteps& steps = steps_of(program);
  if (!steps.obstacle.empty() || !has_code(places)) return "";
#if defined(LOCKSTEP_HAS_ASSEMBLER) && defined(__x86_64__)
  const Machine machine = machine_of(scalar_bytes, places);
  Listing listing = lower(steps.traced->any, places, machine);
  schedule(listing, machine.window);
  return print(allocate(listing, machine), listing);
#else
  static_cast<void>(scalar_bytes);
  return "";
#endif
}

const CompiledStep& compiled_step(const Program& program, int scalar_bytes, const TilePlaces& places) {
  const CompiledSteps& steps = steps_of(program);
  const std::lock_guard lock(steps.mutex);
  const auto [found, is_new] = steps.by_target.try_emplace(places.call);
  CompiledStep& step = found->second;
  if (!is_new) return step;
  step.obstacle = steps.obstacle;
  if (step.obstacle.empty() && !has_code(places)) step.obstacle = "machine code is made for AVX2 and AVX-512 only";
  if (!step.obstacle.empty()) return step;
#if defined(LOCKSTEP_HAS_ASSEMBLER) && defined(__x86_64__)
  try {
    make(*steps.traced, scalar_bytes, places, step);
    name_functions(program, step);
  } catch (const std::length_error& error) {
    step.obstacle = error.what();
  }
#else
  static_cast<void>(scalar_bytes);
#endif
  return step;
}

const std::string& plan_obstacle(const Program& program) { return steps_of(program).obstacle; }

const char* speed_obstacle(const Program& program) {
  const Tables<double>& t = program.f64;
  if (trace::traces_bounds(t)) return nullptr;
  if (t.bounds.always) return "friction, kinematic drives or force limits call the tables in every step";
  if (!program.second_phase_anyway) return "where no bound acts, the tables leave out the velocity phase";
  if (t.rounds.used() && t.integrator == Integrator::leapfrog)  // limits act often
    return "leapfrog takes each step in which a bound acts again by the tables";
  return nullptr;
}

}  // namespace lockstep::jit
