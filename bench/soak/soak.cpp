// Steps random models of every feature for as long as one likes. SPDX-License-Identifier: Apache-2.0
//
// It ends with 1 where a promise is broken: bits that depend on threads or savepoints, states that are not finite
// without a fault, errors after compile(). All else it counts; bench/result_pages.py writes the counts to
// docs/results/soak.md.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <vector>

#include "run.h"
#include "tool/progress.h"

namespace {

using namespace lockstep;

// Of all threads.
double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double resident_megabytes() {
  std::ifstream file("/proc/self/statm");
  double all = 0.0, resident = 0.0;
  file >> all >> resident;
  return resident * 4096.0 * 1e-6;
}

}  // namespace

int main(int argc, char** argv) {
  double steps = 1e6;
  std::uint64_t first = 0, only = 0;
  int environments = 64, periods = 200;
  std::string state;
  CLI::App app("Steps random models of every feature, with random actions, resets, parameters and savepoints.", "soak");
  app.add_option("--steps", steps, "Environment-steps to go on to")->check(CLI::Range(1.0, 1e15));
  app.add_option("--state", state, "JSON file with the counts: is gone on from, and written on the way");
  app.add_option("--first", first, "Seed of the first model, where there is no such file");
  app.add_option("--environments", environments, "Of each model")->check(CLI::Range(1, 65536));
  app.add_option("--periods", periods, "Calls of step() for each model, of 1 to 8 steps")
      ->check(CLI::Range(1, 1000000));
  CLI::Option* one = app.add_option("--only", only, "Runs the model of this seed alone, and prints its counts");
  CLI11_PARSE(app, argc, argv);
  try {
    soak::Totals totals;
    totals.next_seed = first;
    if (*one) {
      totals = soak::run(only, environments, periods);
    } else {
      if (!state.empty() && std::filesystem::exists(state)) totals = soak::load(state);
      totals.memory_early = 0.0;
      tool::Progress progress(steps, "steps");
      const double cpu = totals.cpu_seconds - cpu_seconds();
      for (int seeds = 0; static_cast<double>(totals.steps) < steps && totals.failures.empty();) {
        std::vector<soak::Totals> parts(16);
        tbb::parallel_for(std::size_t{0}, parts.size(), std::size_t{1},
                          [&](std::size_t i) { parts[i] = soak::run(totals.next_seed + i, environments, periods); });
        for (const soak::Totals& part : parts) totals.add(part);
        totals.next_seed += parts.size(), seeds += static_cast<int>(parts.size());
        totals.memory = resident_megabytes();
        if (seeds >= 512 && totals.memory_early == 0.0) totals.memory_early = totals.memory;
        totals.cpu_seconds = cpu + cpu_seconds();
        progress.update(static_cast<double>(totals.steps));
        if (!state.empty()) soak::save(totals, state);
      }
    }
    for (const std::string& failure : totals.failures) fmt::print("FAILED {}\n", failure);
    if (*one) fmt::print("{}", soak::to_json(totals));
    std::uint64_t refused = 0;
    for (const auto& [code, count] : totals.refused) refused += count;
    fmt::print("{} models, {} refused, {:.4g} environment-steps, {:.0f} s of CPU, {} failures\n", totals.models,
               refused, static_cast<double>(totals.steps), totals.cpu_seconds, totals.failures.size());
    return totals.failures.empty() ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "soak: {}\n", error.what());
    return 2;
  }
}
