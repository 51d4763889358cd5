// SPDX-License-Identifier: Apache-2.0
#include "make.h"

#include <algorithm>
#include <cstdint>

#include "allocate.h"
#include "encode.h"
#include "lower.h"
#include "memory.h"
#include "print.h"
#include "schedule.h"

namespace lockstep::jit {
namespace {

Machine machine_of(int scalar_bytes, const TilePlaces& places) { return machine_for(places.bytes == 64, scalar_bytes); }

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
  const auto memory = std::make_shared<const CodeMemory>(bytes);
  if (!memory->start()) {
    step.obstacle = memory->refusal();
    return step;
  }
  step.memory = memory;
  const auto function = [&](std::size_t begin) {
    return reinterpret_cast<StepCode::Function>(reinterpret_cast<std::uintptr_t>(memory->start()) + begin);
  };
  step.code.any = function(begin_any);
  if (traced.consistent) step.code.consistent = function(begin_consistent);
  step.code.rows = {step.rows.data(), static_cast<int>(step.rows.size())};
  return step;
}

std::string print_step(const trace::TracedStep& traced, int scalar_bytes, const TilePlaces& places) {
  const Machine machine = machine_of(scalar_bytes, places);
  Listing listing = lower(traced.any, places, machine);
  schedule(listing, machine.window);
  return print(allocate(listing, machine), listing);
}

}  // namespace lockstep::jit
