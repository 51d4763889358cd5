// lockstep generate: the step of one model as C++ code. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <sstream>

#include "csv.h"
#include "lockstep/generate.h"
#include "options.h"
#include "output.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

struct GenerateOptions {
  ModelOptions model;
  StepOptions step;
  KernelOptions kernel;
  std::string precision = "both", out;
  bool assembly = false;
};

// From a list such as "damping,mass". Throws InputError, which lists the known fields.
ParameterSet parameters_of(const std::string& list) {
  ParameterSet set;
  std::stringstream names(list);
  for (std::string wanted; std::getline(names, wanted, ',');) {
    std::string known;
    bool found = false;
    for (int p = 0; p < parameter_count; ++p) {
      const auto parameter = static_cast<Parameter>(p);
      known += std::string(known.empty() ? "" : ", ") + to_string(parameter);
      if (wanted == to_string(parameter)) set.insert(parameter), found = true;
    }
    if (!found) throw InputError(fmt::format("--per-environment: there is no '{}'; the fields are {}", wanted, known));
  }
  return set;
}

void write_assembly(const Plan& plan, const GenerateOptions& options) {
  const std::string code = machine_code(plan, Target::automatic, options.kernel.f32 ? 4 : 8);
  keep_apart({options.model.file}, {options.out});
  OutputFile file(options.out);
  file.write(code);
  file.close();
  fmt::print("{}: {} lines, {}\n", options.out, std::count(code.begin(), code.end(), '\n'),
             options.kernel.f32 ? "f32" : "f64");
}

void run(GenerateOptions& options) {
  options.kernel.f32 = options.precision != "f64";
  options.kernel.f64 = options.precision != "f32";
  const Plan plan =
      compile(options.model.load(options.step.settings.ignore, {options.out}).model, options.step.settings);
  if (options.assembly) return write_assembly(plan, options);
  const KernelSource source = generate_kernel(plan, options.kernel);
  keep_apart({options.model.file}, {options.out});
  OutputFile file(options.out);
  file.write(source.code);
  file.close();
  fmt::print("{}: {} operations, {} flops a step; kernel {:016x}\n", options.out, source.operations, source.flops,
             source.hash);
}

}  // namespace

void add_generate(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("generate", "Writes the step of one model as straight-line C++ code");
  const auto options = std::make_shared<GenerateOptions>();
  options->model.add_to(*command);
  options->step.add_to(*command);
  add_parsed(*command, "--per-environment", options->step.settings.per_environment, parameters_of,
             "Fields that differ from environment to environment, separated by commas")
      ->type_name("LIST");
  command->add_flag("--record-impulses", options->step.settings.record_impulses, "For batches that record impulses");
  command->add_flag("--record-diagnostics", options->step.settings.record_diagnostics,
                    "For batches that record diagnostics");
  command->add_flag("--stage-inputs", options->step.settings.stage_inputs,
                    "For batches with targets and efforts for the time of each stage");
  command->add_option("--out", options->out, "The C++ file to write")->required();
  command->add_option("--name", options->kernel.name, "Name of the kernel (default: the model's)");
  command->add_option("--precision", options->precision, "f32, f64 or both")
      ->check(CLI::IsMember({"f32", "f64", "both"}));
  command->add_flag("--assembly", options->assembly,
                    "Write the machine code that the engine `compiled` makes for this machine instead, as text");
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
