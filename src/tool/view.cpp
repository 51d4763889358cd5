// lockstep view: a page that plays a motion. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>

#include "lockstep/error.h"
#include "output.h"
#include "replay.h"
#include "run.h"
#include "text.h"
#include "tool.h"
#include "view/page.h"

namespace lockstep::tool {
namespace {

using namespace view;

struct ViewOptions {
  RunOptions run;
  std::vector<int> environments = {0};
  std::vector<std::string> recordings;
  std::string out;
  double rate = 60.0;
};

// What only a simulation uses.
constexpr const char* options_of_runs[] = {"--envs",      "--seconds",      "--precision",  "--engine",
                                           "--tolerance", "--state",        "--targets",    "--perturb",
                                           "--seed",      "--environments", "--dt",         "--integrator",
                                           "--guard",     "--method",       "--iterations", "--velocity-iterations"};

template <class S>
Motion simulated(const ViewOptions& options, const Inputs& inputs, const Run& run) {
  for (const int environment : options.environments)
    if (environment >= options.run.environments)
      throw InputError(fmt::format("--environments: {} is not below the number of environments, {}; raise --envs",
                                   environment, options.run.environments));
  const double dt = run.plan.settings().dt;
  const long interval = sampling_interval(options.rate, dt);
  std::vector<std::string> labels;
  for (const int environment : options.environments) labels.push_back(fmt::format("environment {}", environment));
  Motion motion(run.plan, true, std::move(labels), run.visual_meshes);
  motion.require_room(static_cast<std::size_t>(run.steps / interval + 2));
  Batch<S> batch(run.plan, options.run.environments, {.threads = options.run.threads, .engine = options.run.engine});
  put_to_start(options.run, inputs, batch);
  motion.add(0.0, batch, options.environments);
  advance(batch, inputs.targets_of(run.plan), run.steps, interval, [&](long done) {
    if (done % interval == 0 || done == run.steps)
      motion.add(static_cast<double>(done) * dt, batch, options.environments);
  });
  return motion;
}

struct Shown {
  Motion motion;
  std::string about;
};

// Colliders are read to be drawn. So contacts of the file that a step cannot take are left out.
Run prepared(ViewOptions& options, const Inputs& inputs) {
  ModelOptions& model = options.run.model;
  if (model.ground || !model.contacts.empty()) return prepare(options.run, inputs, {options.out});
  try {
    return prepare(options.run, inputs, {options.out});
  } catch (const SettingsError& error) {
    model.leave_out_contacts = true;
    Run run = prepare(options.run, inputs, {options.out});
    to_stderr(fmt::format("warning: contacts of the file are left out: {}", with_own_options(error.what())));
    return run;
  }
}

Shown simulated(ViewOptions options) {
  const Inputs inputs(options.run);
  const Run run = prepared(options, inputs);
  const StepSettings& settings = run.plan.settings();
  const std::string about =
      fmt::format("{}, {}, step {} s, {}", to_string(run.plan.method()), to_string(run.plan.integrator()),
                  fraction(settings.dt), options.run.f64 ? "f64" : "f32");
  return {options.run.f64 ? simulated<double>(options, inputs, run) : simulated<float>(options, inputs, run), about};
}

Shown replayed(const ViewOptions& options) {
  const StepSettings& settings = options.run.step.settings;
  const Import import = options.run.model.load(settings.ignore, {options.out});
  const Plan plan = compile(import.model, settings);
  std::vector<Recording> recordings;
  for (const std::string& file : options.recordings) recordings.push_back(recording_of(read_csv(file), plan));
  return {replay(recordings, plan, import.visual_meshes, options.rate, options.run.threads), "recorded"};
}

int run(ViewOptions options) {
  require_viewer();
  std::string& out = options.out;
  if (out.empty()) out = std::filesystem::path(options.run.model.file).stem().string() + "_view.html";
  std::vector<std::string> read = options.run.files();
  read.insert(read.end(), options.recordings.begin(), options.recordings.end());
  keep_apart(read, {out});
  require_writable(out);
  const Shown shown = options.recordings.empty() ? simulated(options) : replayed(options);
  const std::vector<std::string> notes = notes_on(shown.motion);
  const std::string page = page_of(shown.motion, shown.about, notes);
  OutputFile file(out);
  file.write(page);
  file.close();
  const std::vector<float>& times = shown.motion.times;
  fmt::print("{}: {:.6g} s in {} samples of {} environment{}, {:.1f} MB\n", out, times.back() - times.front(),
             times.size(), shown.motion.tracks.size(), shown.motion.tracks.size() == 1 ? "" : "s",
             static_cast<double>(page.size()) / 1e6);
  for (const std::string& note : notes) fmt::print("note     {}\n", note);
  std::fflush(stdout);
  int exit_code = fine;
  for (const Track& track : shown.motion.tracks)
    for (const Track::Frozen& frozen : track.frozen) {
      to_stderr(
          fmt::format("{} faulted at {:.4g} s and was frozen: {}", track.label, frozen.time, to_string(frozen.fault)));
      exit_code = some_faulted;
    }
  return exit_code;
}

}  // namespace

void add_view(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("view", "Writes a page that plays a motion, simulated or recorded");
  const auto options = std::make_shared<ViewOptions>();
  options->run.environments = 1;
  options->run.model.import.colliders = true;  // to draw them; they touch what --contact and --ground say
  options->run.add_to(*command);
  command->add_option("-o,--out", options->out, "The page (default MODEL_view.html)")->type_name("FILE");
  command->add_option("--environments", options->environments, "The environments that are shown side by side, from 0")
      ->type_name("I,J,...")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str()
      ->check(number_from(0, (1 << 24) - 1));
  command->add_option("--rate", options->rate, "Samples per second that the page holds, of every step at most")
      ->type_name("HZ")
      ->capture_default_str()
      ->check(number_from(1e-3, 1e6));
  command->add_flag("--visual-meshes", options->run.model.import.visual_meshes,
                    "Draws links as the meshes that the file shows them as, STL, OBJ or MSH");
  CLI::Option* recordings = command->add_option("--record", options->recordings,
                                                "Plays what `simulate --record` wrote instead of a simulation. "
                                                "Repeatable: recordings are shown side by side");
  recordings->type_name("FILE")->allow_extra_args(false);
  for (const char* name : options_of_runs) recordings->excludes(command->get_option(name));
  command->callback([options, &exit_code] { exit_code = run(*options); });
}

}  // namespace lockstep::tool
