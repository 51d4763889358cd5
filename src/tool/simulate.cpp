// lockstep simulate: many environments of one model over a time span. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "diagnose.h"
#include "lockstep/batch.h"
#include "output.h"
#include "rank.h"
#include "record.h"
#include "run.h"
#include "state.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

// Steps between two samples of the coupling errors, at most. A sample costs about as much as a step.
constexpr long longest_sampling_interval = 8;

struct SimulateOptions {
  RunOptions run;
  RankOption rank;
  int recorded = 0;
  std::string record, json, end_states;

  IdRange ids() const { return ids_of(rank, run.environments); }
  /// Whether this rank has the environment that is recorded.
  bool records() const {
    const std::int64_t place = std::int64_t{recorded} - ids().first;
    return !record.empty() && place >= 0 && place < ids().count;
  }
};

struct Outcome {
  long steps = 0;
  int threads = 1;
  double stepping_seconds = 0.0;  ///< wall clock, in Batch::step alone
  Target target = Target::automatic;
  Engine engine = Engine::automatic;
  double coupling_error_max = 0.0, coupling_error_rms = 0.0;  ///< with loops; NaN where every environment faulted
  int faulted = 0, first_faulted = -1;                        ///< the first is an id
  FaultReport first_fault = {};
  std::string first_joint = {};
  std::string explanation = {};  ///< Batch::explain_fault() of the first
};

// Largest and root mean square error of couplings and loops over the environments that have not faulted.
template <class S>
void sample(const Batch<S>& batch, const typename Batch<S>::Array& coupling_errors, Outcome& outcome) {
  const typename Batch<S>::Array loop_errors = batch.loop_errors();
  double sum = 0.0;
  long count = 0;
  for (int e = 0; e < batch.environments(); ++e) {
    if (batch.faults()[e] != Fault::none) continue;
    for (const typename Batch<S>::Array* const errors : {&coupling_errors, &loop_errors}) {
      for (Eigen::Index c = 0; c < errors->rows(); ++c) {
        const double error = std::abs(static_cast<double>((*errors)(c, e)));
        outcome.coupling_error_max = std::max(outcome.coupling_error_max, error);
        sum += error * error;
      }
      count += errors->rows();
    }
  }
  outcome.coupling_error_rms = count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
}

template <class S>
void note_faults(const Batch<S>& batch, Outcome& outcome) {
  outcome.faulted = batch.faulted();
  int first = -1;
  for (int e = batch.environments() - 1; e >= 0; --e)
    if (batch.faults()[e] != Fault::none) first = e;
  if (outcome.faulted > 0) {
    outcome.first_faulted = static_cast<int>(batch.ids()[first]);
    outcome.first_fault = batch.fault_report(first);
    if (outcome.first_fault.dof >= 0) outcome.first_joint = batch.plan().dof_names()[outcome.first_fault.dof];
    outcome.explanation = batch.explain_fault(first);
  }
  if (outcome.faulted == batch.environments())
    outcome.coupling_error_max = outcome.coupling_error_rms = std::numeric_limits<double>::quiet_NaN();
}

template <class S>
Outcome run(const SimulateOptions& options, const Inputs& inputs, const Plan& plan, long steps) {
  const Targets targets = inputs.targets_of(plan);
  const IdRange ids = options.ids();
  Batch<S> batch(plan, ids.count,
                 {.threads = options.run.threads, .engine = options.run.engine, .first_id = ids.first});
  batch.step();  // wakes the threads and maps the memory, before the clock runs
  batch.reset();
  put_to_start(options.run, inputs, batch);
  Recorder recorder =
      options.records() ? Recorder(options.record, options.recorded - static_cast<int>(ids.first), plan) : Recorder();
  if (recorder.active()) recorder.add(0.0, batch, batch.coupling_errors());

  Outcome outcome{.steps = steps, .threads = batch.threads(), .target = batch.target(), .engine = batch.engine()};
  outcome.stepping_seconds =
      advance(batch, targets, steps, recorder.active() ? 1 : longest_sampling_interval, [&](long done) {
        const typename Batch<S>::Array errors = batch.coupling_errors();
        sample(batch, errors, outcome);
        if (recorder.active()) recorder.add(static_cast<double>(done) * plan.settings().dt, batch, errors);
      });
  recorder.close();
  if (!options.end_states.empty()) write_states(options.end_states, options.rank.rank == 0, batch);
  note_faults(batch, outcome);
  return outcome;
}

bool is_bounded(const Plan& plan) { return plan.row_names().size() > static_cast<std::size_t>(plan.couplings()); }

// Runs the first environments once more and records diagnostics. The timed run records none, as that takes time. Only
// the tables are sure to take a plan that records.
template <class S>
Diagnosis diagnosed(const SimulateOptions& options, const Inputs& inputs, const Plan& plan, long steps) {
  const auto run = [&](const StepSettings& settings) {
    const Plan recording = compile(plan.model(), settings);
    const Engine engine = options.run.engine == Engine::tables ? Engine::tables : Engine::automatic;
    const IdRange ids = options.ids();
    Batch<S> batch(recording, std::min(ids.count, most_diagnosed),
                   {.threads = options.run.threads, .engine = engine, .first_id = ids.first});
    put_to_start(options.run, inputs, batch);
    return diagnose(batch, inputs.targets_of(recording), steps);
  };
  StepSettings settings = plan.settings();
  const bool touches = !plan.contacts().empty();  // nothing is recorded beside contacts
  settings.record_diagnostics = plan.integrator() == Integrator::euler && !touches;
  Diagnosis diagnosis = run(settings);
  if (settings.record_diagnostics || touches || !is_bounded(plan)) return diagnosis;
  // Only Euler records conflicts. They lie in the model and its inputs, so those of Euler are those of all.
  settings.record_diagnostics = true;
  settings.integrator = Integrator::euler;
  const Diagnosis by_euler = run(settings);
  diagnosis.conflict_count = by_euler.conflict_count;
  diagnosis.conflicts = by_euler.conflicts;
  return diagnosis;
}

double speed(const SimulateOptions& options, const Outcome& outcome) {
  return static_cast<double>(outcome.steps) * options.ids().count / std::max(outcome.stepping_seconds, 1e-9);
}

void print(const SimulateOptions& options, const Plan& plan, const Outcome& outcome) {
  const double simulated = static_cast<double>(outcome.steps) * plan.settings().dt;
  const bool sweeps = plan.method() == Method::pgs || plan.method() == Method::tgs;
  const std::size_t loops = plan.loops().size();
  fmt::print("model    {}: {} joints, {} couplings, {}{} base\n", plan.model().name, plan.dofs(), plan.couplings(),
             loops == 0 ? "" : fmt::format("{} loop{}, ", loops, loops == 1 ? "" : "s"), base_of(plan.model()));
  fmt::print("method   {}{}, {}, {}, step {} s, {} thread{}, {}, {}\n", to_string(plan.method()),
             sweeps ? fmt::format(" {}+{}", plan.settings().iterations, plan.settings().velocity_iterations) : "",
             to_string(plan.integrator()), options.run.f64 ? "f64" : "f32", fraction(plan.settings().dt),
             outcome.threads, outcome.threads == 1 ? "" : "s", to_string(outcome.target), to_string(outcome.engine));
  const IdRange ids = options.ids();
  if (options.rank.ranks > 1)
    fmt::print("rank     {} of {}: ids {} to {} of {} environments\n", options.rank.rank, options.rank.ranks, ids.first,
               ids.first + static_cast<unsigned>(ids.count) - 1, options.run.environments);
  fmt::print("run      {} environments x {} steps = {:.6g} s each\n", ids.count, outcome.steps, simulated);
  if (std::abs(simulated - options.run.seconds) > 1e-9 * options.run.seconds)
    fmt::print("         (rounded: {:.6g} s is not a whole number of steps)\n", options.run.seconds);
  fmt::print("speed    {} env-steps/s in {:.3g} s of stepping\n", with_prefix(speed(options, outcome)),
             outcome.stepping_seconds);
  if (outcome.faulted == ids.count)
    fmt::print("|C|      none: every environment faulted\n");
  else
    fmt::print("|C|      max {:.2e}, rms at the end {:.2e} (rad, m)\n", outcome.coupling_error_max,
               outcome.coupling_error_rms);
  fmt::print("faults   {}\n", outcome.faulted == 0 ? "none" : fmt::format("{} environments", outcome.faulted));
}

void print_contacts(const Diagnosis& diagnosis) {
  fmt::print(
      "contacts {:.3g} pairs are near, {:.3g} press, penetration max {:.2e} m, slip max {:.2e} m/s; {:.1f} rounds a "
      "step, "
      "of a tile {:.1f}{}\n",
      diagnosis.near_mean, diagnosis.contacts_mean, diagnosis.penetration_max, diagnosis.slip_max,
      diagnosis.rounds_mean, diagnosis.tile_rounds_mean,
      diagnosis.unfinished_contacts == 0 ? "" : fmt::format(", {} solves not finished", diagnosis.unfinished_contacts));
}

void warn(const Diagnosis& diagnosis) {
  if (diagnosis.conflict_count == 0) return;
  const Conflict& first = diagnosis.conflicts.front();
  fmt::print(
      "warning  bounds and couplings could not all be met in {} of the {} environments that were diagnosed; "
      "first in environment {} at {:.4g} s: {}\n",
      diagnosis.conflict_count, diagnosis.environments, first.environment, first.time, fmt::join(first.rows, ", "));
}

std::string as_json(const SimulateOptions& options, const Plan& plan, const Outcome& outcome,
                    const Diagnosis& diagnosis) {
  nlohmann::ordered_json json;
  json["model"] = plan.model().name;
  json["file"] = options.run.model.file;
  json["env_steps_per_second"] = speed(options, outcome);
  json["coupling_error_max"] = outcome.coupling_error_max;  // null for NaN
  json["coupling_error_rms"] = outcome.coupling_error_rms;
  json["faulted_environments"] = outcome.faulted;
  if (outcome.faulted > 0)
    json["first_fault"] = {{"environment", outcome.first_faulted},
                           {"fault", to_string(outcome.first_fault.fault)},
                           {"code", code_of(outcome.first_fault.fault)},
                           {"stage", to_string(outcome.first_fault.stage)},
                           {"joint", outcome.first_joint},
                           {"step", outcome.first_fault.step},
                           {"time", outcome.first_fault.time}};
  json["diagnosed_environments"] = diagnosis.environments;
  json["energy_excess_max"] = diagnosis.energy_excess_max;
  json["limit_violation_max"] = diagnosis.limit_violation_max;
  json["speed_max"] = diagnosis.speed_max;
  json["conflict_count"] = diagnosis.conflict_count;  // 0 in smooth scenes
  json["conflicts"] = nlohmann::ordered_json::array();
  for (const Conflict& conflict : diagnosis.conflicts)
    json["conflicts"].push_back(
        {{"environment", conflict.environment}, {"time", conflict.time}, {"rows", conflict.rows}});
  if (!plan.contacts().empty())
    json["contacts"] = {{"pairs", plan.contacts().size()},
                        {"near_mean", diagnosis.near_mean},
                        {"points_mean", diagnosis.points_mean},
                        {"pressing_mean", diagnosis.contacts_mean},
                        {"rounds_mean", diagnosis.rounds_mean},
                        {"tile_rounds_mean", diagnosis.tile_rounds_mean},
                        {"penetration_max", diagnosis.penetration_max},
                        {"slip_max", diagnosis.slip_max},
                        {"unfinished", diagnosis.unfinished_contacts}};
  json["method"] = to_string(plan.method());
  json["integrator"] = to_string(plan.integrator());
  json["iterations"] = plan.settings().iterations;
  json["velocity_iterations"] = plan.settings().velocity_iterations;
  json["precision"] = options.run.f64 ? "f64" : "f32";
  json["threads"] = outcome.threads;
  json["target"] = to_string(outcome.target);
  json["engine"] = to_string(outcome.engine);
  json["dt"] = plan.settings().dt;
  json["envs"] = options.ids().count;
  json["first_id"] = options.ids().first;
  json["steps"] = outcome.steps;
  json["seconds"] = static_cast<double>(outcome.steps) * plan.settings().dt;
  json["stepping_seconds"] = outcome.stepping_seconds;
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void write_json(const SimulateOptions& options, const std::string& text) {
  if (options.json.empty()) return;
  OutputFile json(options.json);
  json.write(text);
  json.close();
}

std::string as_json(const Error& error) {
  const nlohmann::ordered_json json = {
      {"error",
       {{"code", error.code()}, {"element", error.element()}, {"rule", error.rule()}, {"remedy", error.remedy()}}}};
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int run(const SimulateOptions& options) {
  if (options.recorded >= options.run.environments)
    throw InputError(fmt::format("--record-env: {} is not below the number of environments, {}", options.recorded,
                                 options.run.environments));
  const std::vector<std::string> outputs = {options.record, options.json, options.end_states};
  keep_apart(options.run.files(), outputs);
  for (const std::string& output : outputs) require_writable(output);  // before a long run
  const Inputs inputs(options.run);
  const auto [plan, steps, visual_meshes] = prepare(options.run, inputs, outputs);
  const Outcome outcome =
      options.run.f64 ? run<double>(options, inputs, plan, steps) : run<float>(options, inputs, plan, steps);
  print(options, plan, outcome);
  // Only Euler's scenes have bounds that could be in conflict.
  if (!options.json.empty() || plan.integrator() == Integrator::euler || is_bounded(plan)) {
    const Diagnosis diagnosis = options.run.f64 ? diagnosed<double>(options, inputs, plan, steps)
                                                : diagnosed<float>(options, inputs, plan, steps);
    if (!plan.contacts().empty()) print_contacts(diagnosis);
    warn(diagnosis);
    write_json(options, as_json(options, plan, outcome, diagnosis));
  }
  if (outcome.faulted == 0) return fine;
  std::fflush(stdout);
  to_stderr(
      fmt::format("{} of {} environments faulted; the first is number {}: {}", outcome.faulted, options.ids().count,
                  outcome.first_faulted,
                  outcome.explanation.substr(outcome.explanation.find(": ") + 2)));  // without the environment's number
  return some_faulted;
}

}  // namespace

void add_simulate(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("simulate", "Steps many environments; says how fast and how accurately");
  const auto options = std::make_shared<SimulateOptions>();
  options->run.add_to(*command);
  add_rank(*command, options->rank, "Simulates the share of --envs that rank R of N has");
  command
      ->add_option("--end-states", options->end_states,
                   "Writes the last state of each environment as CSV, as --state reads it. Only rank 0 writes the "
                   "line of names")
      ->type_name("FILE");
  CLI::Option* const record =
      command->add_option("--record", options->record, "Writes one environment's trajectory as CSV")->type_name("FILE");
  command->add_option("--record-env", options->recorded, "The environment that --record writes, from 0")
      ->type_name("I")
      ->capture_default_str()
      ->check(CLI::Range(0, (1 << 24) - 1))
      ->needs(record);
  command->add_option("--json", options->json, "Writes the results as JSON")->type_name("FILE");
  command->callback([options, &exit_code] {
    options->json = name_of_rank("--json", options->json, options->rank);
    options->end_states = name_of_rank("--end-states", options->end_states, options->rank);
    try {
      exit_code = run(*options);
    } catch (const Error& error) {  // found after the names of files were
      if (!std::filesystem::exists(options->json)) write_json(*options, as_json(error));  // results before it stay
      throw;
    }
  });
}

}  // namespace lockstep::tool
