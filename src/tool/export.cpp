// lockstep export: the mechanism as MJCF or URDF. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "csv.h"
#include "lockstep/export_model.h"
#include "options.h"
#include "output.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

struct Options {
  ModelOptions model;
  MjcfOptions mjcf;
  std::string out, format;
};

bool is_urdf(const Options& options) {
  if (!options.format.empty()) return options.format == "urdf";
  const std::string extension = std::filesystem::path(options.out).extension().string();
  if (extension != ".urdf" && extension != ".xml" && extension != ".mjcf")
    throw InputError(fmt::format(
        "--out: '{}' ends with none of .xml and .mjcf (MJCF) and .urdf; rename it or give --format", options.out));
  return extension == ".urdf";
}

void run(const Options& options) {
  const bool urdf = is_urdf(options);
  keep_apart({options.model.file}, {options.out});
  const Model model = options.model.load({}, {options.out}).model;
  const Export made = urdf ? export_urdf(model) : export_mjcf(model, options.mjcf);
  OutputFile file(options.out);
  file.write(made.text);
  file.close();
  for (const std::string& line : made.warnings) to_stderr("warning: " + line);
  fmt::print("{}\n", options.out);
  for (const std::string& line : made.report) fmt::print("  {}\n", line);
}

}  // namespace

void add_export(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("export", "Writes the mechanism as MJCF or URDF");
  const auto options = std::make_shared<Options>();
  options->model.add_to(*command);
  command->add_option("--out", options->out, "The file to write")->required();
  command->add_option("--format", options->format, "mjcf or urdf (default: by the extension of --out)")
      ->check(CLI::IsMember({"mjcf", "urdf"}));
  add_parsed(
      *command, "--timestep", options->mjcf.timestep,
      [](const std::string& text) { return seconds_of(text, "--timestep"); },
      "MJCF: the step in s that MuJoCo shall take; it holds couplings as well as this step can")
      ->type_name("H")
      ->default_str("the model's, or 0.001");
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
