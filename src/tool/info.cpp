// lockstep info: what a model file holds and what a step does. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "lockstep/plan.h"
#include "options.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

struct InfoOptions {
  ModelOptions model;
  StepOptions step;
};

void run(const InfoOptions& options) {
  const Import import = options.model.load();
  const Plan plan = compile(import.model, options.step.settings);
  fmt::print("{}\n", options.model.file);
  for (const std::string& line : import.report) fmt::print("  {}\n", line);
  std::string description = plan.describe();
  while (description.ends_with('\n')) description.pop_back();
  fmt::print("\n{}\n", description);
}

}  // namespace

void add_info(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("info", "Says what a model file holds and what a step does");
  const auto options = std::make_shared<InfoOptions>();
  options->model.add_to(*command);
  options->step.add_to(*command);
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
