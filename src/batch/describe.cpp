// What the steps of a batch cost, in words. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "impl.h"

namespace lockstep {

namespace {

std::string code_line(const jit::CompiledStep& step) {
  const auto function = [](const jit::CodeSize& size) {
    return fmt::format("{} operations in {} bytes and {} part{}", size.operations, size.bytes, size.parts,
                       size.parts == 1 ? "" : "s");
  };
  std::vector<std::string> routines;
  for (int i = 0; i < kernels::routine_count; ++i)
    if (step.code.routine[i])
      routines.push_back(fmt::format("{} {}", kernels::routine_names[i], step.routine_bytes[i]));
  if (!routines.empty())
    return fmt::format("Its machine code, in bytes: {}; {} numbers of a tile in memory beside its arrays.\n",
                       fmt::join(routines, ", "), step.code.slots);
  return fmt::format("Its machine code: {}{}; {} numbers of a tile in memory beside its arrays.\n", function(step.any),
                     step.code.consistent ? ", where followers are consistent " + function(step.consistent) : "",
                     step.code.slots);
}

}  // namespace

template <class S>
std::string Batch<S>::describe() const {
  const Impl& batch = impl();
  const Plan& plan = batch.plan;
  const int threads = batch.workers.concurrency(), domain = batch.workers.memory_domain();
  std::string text =
      fmt::format("{} environments of '{}', {}, {}, {}, {} thread{}{}.\n", batch.environments, plan.model().name,
                  sizeof(S) == 4 ? "f32" : "f64", to_string(batch.target), to_string(engine()), threads,
                  threads == 1 ? "" : "s", domain < 0 ? "" : fmt::format(" of memory domain {}", domain));
  if (batch.chosen.compiled) text += code_line(*batch.chosen.compiled);
  if (!batch.tables.counts_solves()) return text + "Nothing in its steps is solved by rounds.\n";
  const auto sum_of = [&](int row) {
    const S* const numbers = batch.rows.solve_counts.data() + row * batch.stride;
    return std::accumulate(numbers, numbers + batch.environments, 0.0);
  };
  const bool touches = batch.tables.contacts.used();
  const double steps = sum_of(touches ? 0 : 4);
  if (steps == 0.0)
    return text + (touches ? "It has taken no step yet.\n" : "Its last steps, if any, needed no rounds.\n");
  const auto mean_of = [&](int row) { return sum_of(row) / steps; };
  if (!touches)
    text += "No contacts. In the mean of a solve of rows over several velocities:\n";
  else
    text += fmt::format(
        "Contacts, in the mean of an environment and step: {} pairs declared, {:.1f} near; {:.1f} points "
        "could act, {:.1f} pressed.\n",
        plan.contacts().size(), mean_of(1), mean_of(2), mean_of(3));
  text += fmt::format(
      "Solves: {:.2f} with {:.2f} passes, {:.1f} rounds and {:.1f} search trials. Its tile, whose lanes "
      "wait for each other, went through {:.1f} points, {:.1f} rounds and {:.1f} trials.\n",
      mean_of(4), mean_of(5), mean_of(6), mean_of(7), mean_of(8), mean_of(9), mean_of(10));
  if (!touches) return text;
  const Query query{Quantity::unfinished_contacts};
  Array unfinished(1, batch.environments);
  read(std::span(&query, 1), {unfinished.data(), batch.environments, 1});
  return text + fmt::format("Ended at their cap since the resets: {} solves.\n", static_cast<long>(unfinished.sum()));
}

template std::string Batch<float>::describe() const;
template std::string Batch<double>::describe() const;

}  // namespace lockstep
