// SPDX-License-Identifier: Apache-2.0
#include "run.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>

#include "output.h"
#include "progress.h"
#include "state.h"
#include "text.h"
#include "tolerance.h"
#include "tool.h"

namespace lockstep::tool {

void RunOptions::add_to(CLI::App& app) {
  model.add_to(app);
  step.add_to(app);
  app.add_option("--envs", environments, "Number of environments")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 24));
  add_parsed(
      app, "--seconds", seconds, [](const std::string& text) { return seconds_of(text, "--seconds"); },
      "Simulated time in s")
      ->type_name("T")
      ->default_str("1");
  add_parsed(
      app, "--precision", f64,
      [](const std::string& text) {
        if (text != "f32" && text != "f64")
          throw InputError(fmt::format("--precision: there is no '{}'; give f32 or f64", text));
        return text == "f64";
      },
      "f32 or f64")
      ->type_name("P")
      ->default_str("f32");
  add_parsed(app, "--engine", engine, engine_of,
             "What runs the step: automatic, tables, compiled, generated. An engine that does not take the plan is "
             "an error")
      ->type_name("ENGINE")
      ->default_str("automatic");
  app.add_option(
         "--tolerance", tolerance,
         "Takes the cheapest integrator and step that keep the joints this close to the exact motion, RMS, rad or m")
      ->type_name("E")
      ->check(number_from(1e-15, 1e3))
      ->excludes("--dt");
  app.add_option("--threads", threads, "Number of threads; 0: as many as may be used")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  app.add_option("--state", state, "CSV of start states: one row for all environments, or one for each")
      ->type_name("FILE");
  app.add_option("--targets", targets, "CSV of drive targets over time")->type_name("FILE");
  app.add_option("--perturb", sigma,
                 "Adds normal noise, rad or m, to the start of every joint that follows none, within position ranges")
      ->type_name("SIGMA")
      ->check(number_from(0.0, 1e3));
  app.add_option("--seed", seed, "Seed of the noise, a whole number below 2^64")
      ->type_name("S")
      ->capture_default_str()
      ->check(CLI::Validator(
          [](const std::string& text) {
            std::uint64_t number = 0;
            const char* const end = text.data() + text.size();
            const auto [behind, error] = std::from_chars(text.data(), end, number);
            return error == std::errc() && behind == end ? "" : "'" + text + "' is no whole number from 0 to 2^64 - 1";
          },
          ""));
}

Inputs::Inputs(const RunOptions& options) {
  if (!options.targets.empty()) targets = read_csv(options.targets);
  if (!options.state.empty()) state = read_csv(options.state);
}

namespace {

long step_count(double seconds, double dt) {
  const double steps = std::round(seconds / dt);
  if (steps < 1.0)
    throw InputError(fmt::format("--seconds: {} s is less than half a step of {} s", seconds, fraction(dt)));
  if (steps > 1e12) throw InputError(fmt::format("--seconds: {} s are {} steps, too many to take", seconds, steps));
  return static_cast<long>(steps);
}

// The joint with the longest delay, or null.
const Joint* most_delayed(const Model& model) {
  const auto most = std::max_element(model.joints.begin(), model.joints.end(),
                                     [](const Joint& a, const Joint& b) { return a.drive.delay < b.drive.delay; });
  return most != model.joints.end() && most->drive.delay > 0 ? &*most : nullptr;
}

// With --tolerance: the step that meets it, tried from the first environment's start.
std::optional<Chosen> chosen_step(const RunOptions& options, const Inputs& inputs, const Model& model) {
  if (options.tolerance == 0.0) return std::nullopt;
  if (const Joint* const joint = most_delayed(model))
    throw InputError(
        fmt::format("--tolerance: the delay of joint '{}' is a number of steps, {}, so each step has another motion; "
                    "give --dt",
                    joint->name, joint->drive.delay));
  Model start = model;
  if (std::optional<Table> state = inputs.state) {
    state->rows.resize(1);
    start = with_state(std::move(start), *state);
  }
  StepSettings for_names = options.step.settings;  // the targets need a plan's joints; no step of it is taken
  for_names.integrator = Integrator::automatic;
  const Targets targets = inputs.targets_of(compile(model, for_names));
  const Chosen chosen =
      choose_step(start, options.step.settings, options.f64, options.tolerance, options.seconds, targets);
  fmt::print("chosen   {}: error {:.1e} (rad, m; RMS over {:g} s of one environment), tolerance {:g}\n",
             described(chosen.setting), chosen.error, chosen.seconds, options.tolerance);
  return chosen;
}

// Delays are numbers of steps, so another step than the file's makes them other times.
void warn_of_delays(const Model& model, double dt) {
  const Joint* const joint = most_delayed(model);
  if (!joint || model.time_step == 0.0 || std::abs(dt - model.time_step) < 1e-9 * dt) return;
  to_stderr(
      fmt::format("warning: the delay of joint '{0}' is {1} steps, {2:.4g} s at this step of {3} s and {4:.4g} s at "
                  "the file's; give "
                  "--dt {5:.10g}",
                  joint->name, joint->drive.delay, joint->drive.delay * dt, fraction(dt),
                  joint->drive.delay * model.time_step, model.time_step));
}

StepSettings settings_of(const RunOptions& options, const std::optional<Chosen>& chosen) {
  StepSettings settings = options.step.settings;
  if (!chosen) return settings;
  settings.dt = 1.0 / chosen->setting.steps_per_second;
  settings.integrator = chosen->setting.integrator;
  return settings;
}

}  // namespace

Run prepare(const RunOptions& options, const Inputs& inputs, const std::vector<std::string>& outputs) {
  Import import = options.model.load(options.step.settings.ignore, outputs);
  const std::optional<Chosen> chosen = chosen_step(options, inputs, import.model);
  const Plan plan = compile(import.model, settings_of(options, chosen));
  warn_of_delays(import.model, plan.settings().dt);
  return {plan, step_count(options.seconds, plan.settings().dt), std::move(import.visual_meshes)};
}

template <class S>
void put_to_start(const RunOptions& options, const Inputs& inputs, Batch<S>& batch) {
  if (std::optional<Table> state = inputs.state) {
    require_rows(*state, options.environments);
    if (state->rows.size() > 1) {
      const auto first = static_cast<std::ptrdiff_t>(batch.ids()[0]), end = first + batch.environments();
      state->rows = std::vector(state->rows.begin() + first, state->rows.begin() + end);
      state->lines = std::vector(state->lines.begin() + first, state->lines.begin() + end);
    }
    apply_state(*state, batch);
  }
  if (options.sigma > 0.0) perturb(options.sigma, options.seed, batch);
}

template <class S>
double advance(Batch<S>& batch, const Targets& targets, long steps, long interval,
               const std::function<void(long)>& after) {
  using Clock = std::chrono::steady_clock;
  const double dt = batch.plan().settings().dt;
  Progress progress(static_cast<double>(steps) * batch.environments(), "env-steps");
  double stepping_seconds = 0.0;
  int target_row = -1;
  for (long done = 0; done < steps;) {
    if (const int row = targets.row_at(done, dt); row != target_row) targets.apply(target_row = row, batch);
    int count = 1;
    while ((done + count) % interval != 0 && done + count < steps && targets.row_at(done + count, dt) == target_row)
      ++count;

    const Clock::time_point start = Clock::now();
    batch.step(count);
    stepping_seconds += std::chrono::duration<double>(Clock::now() - start).count();
    done += count;

    after(done);
    progress.update(static_cast<double>(done) * batch.environments());
  }
  return stepping_seconds;
}

template void put_to_start(const RunOptions&, const Inputs&, Batch<float>&);
template void put_to_start(const RunOptions&, const Inputs&, Batch<double>&);
template double advance(Batch<float>&, const Targets&, long, long, const std::function<void(long)>&);
template double advance(Batch<double>&, const Targets&, long, long, const std::function<void(long)>&);

}  // namespace lockstep::tool
