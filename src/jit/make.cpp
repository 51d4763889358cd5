// SPDX-License-Identifier: Apache-2.0
#include "make.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "allocate.h"
#include "encode.h"
#include "lower.h"
#include "memory.h"
#include "print.h"
#include "schedule.h"

namespace lockstep::jit {
namespace {

Machine machine_of(int scalar_bytes, const TilePlaces& places) { return machine_for(places.bytes == 64, scalar_bytes); }

// One tile at a time gains nothing from parts.
Machine machine_of_routines(int scalar_bytes, const TilePlaces& places) {
  Machine machine = machine_of(scalar_bytes, places);
  machine.longest = std::numeric_limits<int>::max();
  return machine;
}

// Appends the code of a listing to the bytes, and returns where it begins.
std::size_t append(Listing& listing, const TilePlaces& places, const Machine& machine, CodeSize& size, StepCode& code,
                   std::vector<std::uint8_t>& bytes) {
  schedule(listing, machine.window);
  const Allocated allocated = allocate(listing, machine);
  const std::vector<std::uint8_t> encoded = encode(allocated, listing.constants, machine, places.call);
  size = {static_cast<int>(listing.operations.size()), static_cast<int>(encoded.size()), allocated.parts};
  code.slots = std::max(code.slots, allocated.slots);
  if (allocated.parts > 1) code.tiles = machine.tiles;
  bytes.resize((bytes.size() + 63) / 64 * 64);
  const std::size_t begin = bytes.size();
  bytes.insert(bytes.end(), encoded.begin(), encoded.end());
  return begin;
}

// Puts the code where it can run. Returns where it begins, or 0 and why not in the step.
std::uintptr_t keep(const std::vector<std::uint8_t>& bytes, CompiledStep& step) {
  const auto memory = std::make_shared<const CodeMemory>(bytes);
  if (memory->start())
    step.memory = memory;
  else
    step.obstacle = memory->refusal();
  step.code.rows = {step.rows.data(), static_cast<int>(step.rows.size())};
  return reinterpret_cast<std::uintptr_t>(memory->start());
}

std::string print_graph(const trace::Graph& graph, const TilePlaces& places, const Machine& machine) {
  Listing listing = lower(graph, places, machine);
  schedule(listing, machine.window);
  return print(allocate(listing, machine), listing);
}

}  // namespace

std::string build_obstacle() { return ""; }

CompiledStep make(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places) {
  const Machine machine = machine_of(scalar_bytes, places);
  CompiledStep step;
  Listing consistent;
  if (traced.consistent) consistent = lower(*traced.consistent, places, machine);
  Listing any = lower(traced.any, places, machine, consistent.rows);
  step.rows = consistent.rows = any.rows;  // both read the same slots
  std::vector<std::uint8_t> bytes;
  const std::size_t begin_any = append(any, places, machine, step.any, step.code, bytes);
  std::size_t begin_consistent = 0;
  if (traced.consistent) begin_consistent = append(consistent, places, machine, step.consistent, step.code, bytes);
  const std::uintptr_t start = keep(bytes, step);
  if (start == 0) return step;
  step.code.any = reinterpret_cast<StepCode::Function>(start + begin_any);
  if (traced.consistent) step.code.consistent = reinterpret_cast<StepCode::Function>(start + begin_consistent);
  return step;
}

CompiledStep make(const trace::TracedRoutines& traced, int scalar_bytes, const TilePlaces& places) {
  const Machine machine = machine_of_routines(scalar_bytes, places);
  CompiledStep step;
  std::vector<Listing> listings;
  for (const std::optional<trace::Graph>& routine : traced.graph)
    if (routine) {
      listings.push_back(lower(*routine, places, machine, step.rows));
      step.rows = listings.back().rows;
    }
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> begins;
  std::vector<CodeSize> sizes;
  for (Listing& listing : listings) {
    listing.rows = step.rows;  // all read the same slots
    CodeSize size;
    begins.push_back(append(listing, places, machine, size, step.code, bytes));
    sizes.push_back(size);
  }
  for (const trace::Place& place : traced.unread) step.unread.push_back({0, place.array, place.number});
  step.code.unread = {step.unread.data(), static_cast<int>(step.unread.size())};
  step.code.tiles = 1;
  const std::uintptr_t start = keep(bytes, step);
  if (start == 0) return step;
  for (std::size_t i = 0, made = 0; i < traced.graph.size(); ++i) {
    if (!traced.graph[i]) continue;
    step.code.routine[i] = reinterpret_cast<kernels::RoutineCode>(start + begins[made]);
    step.routine_bytes[i] = sizes[made++].bytes;
  }
  return step;
}

std::string print_step(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places) {
  return print_graph(traced.any, places, machine_of(scalar_bytes, places));
}

std::string print_routines(const trace::TracedRoutines& traced, int scalar_bytes, const TilePlaces& places) {
  std::string all;
  for (std::size_t i = 0; i < traced.graph.size(); ++i)
    if (traced.graph[i])
      all += std::string(kernels::routine_names[i]) + ":\n" +
             print_graph(*traced.graph[i], places, machine_of_routines(scalar_bytes, places));
  return all;
}

}  // namespace lockstep::jit
