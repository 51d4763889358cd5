// lockstep chart: measures and draws error against cost of the methods on a model. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "chart_runs.h"
#include "chart_script.h"
#include "csv.h"
#include "lockstep/error.h"
#include "options.h"
#include "output.h"
#include "progress.h"
#include "python.h"
#include "rank.h"
#include "state.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr double largest_error = 10.0;   // rad or m; beyond it a run has failed
constexpr double longest_motion = 60.0;  // s
constexpr int rounds = 5;                // of cost measurements: each takes every setting once
constexpr int fewest_environments = 64, most_environments = 4096;
constexpr double predictable_from = 3.0;  // advice is for errors of at least this many times the truth's own
constexpr double predictable = 0.1;       // a truth with a larger share of the smallest error is too coarse
constexpr double truth_share = 0.2;       // of the progress bar

struct ChartOptions {
  ModelOptions model;
  Ignored ignore;
  std::string out, csv, python, state, table;
  RankOption rank;
  int environments = 0;  // 0: as many as fit the budget
  double seconds = 1.0, budget = 25.0;
};

// The model with the start of the file, or without a file with a start that moves.
Model with_start(const ChartOptions& options, Model model) {
  model.validate();
  if (options.state.empty()) return with_moving_start(std::move(model));
  return with_state(std::move(model), read_csv(options.state));
}

// The settings that the model allows. Prints why it does not allow the others.
std::vector<ChartSetting> possible_settings(const Model& model, const Ignored& ignore) {
  std::vector<ChartSetting> possible;
  std::map<std::string, std::string> refused;  // by family: the last reason
  std::map<std::string, int> accepted;         // by family: how many
  for (const ChartSetting& setting : chart_settings(model, ignore)) {
    try {
      compile_setting(model, setting);
      possible.push_back(setting);
      ++accepted[family(setting)];
    } catch (const SettingsError& error) {
      const std::string why = error.what(), before = "apply: ";
      refused[family(setting)] = why.find(before) < why.size() ? why.substr(why.find(before) + before.size()) : why;
    }
  }
  std::map<std::string, std::vector<std::string>> by_reason;
  for (const auto& [what, why] : refused) by_reason[why].push_back(accepted[what] > 0 ? what + " at some steps" : what);
  for (const auto& [why, what] : by_reason) fmt::print("left out {}: {}\n", fmt::join(what, ", "), why);
  return possible;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

struct Measured {
  std::vector<ChartPoint> points;
  int environments;
};

Measured measure(const ChartOptions& options, const Model& model, const Truth& truth,
                 const std::function<void(double)>& tick) {
  const int samples = static_cast<int>(truth.positions.cols());
  std::vector<ChartSetting> settings = possible_settings(model, options.ignore);
  const IdRange share = ids_of(options.rank, static_cast<std::int64_t>(settings.size()));
  settings = std::vector(settings.begin() + share.first, settings.begin() + share.first + share.count);
  Measured result{{}, options.environments};
  std::vector<Plan> plans;
  std::vector<double> expected;
  for (const ChartSetting& setting : settings) {
    plans.push_back(compile_setting(model, setting));
    result.points.push_back(measure_error(plans.back(), setting, truth));
    expected.push_back(measure_cost(plans.back(), setting.f64, samples, fewest_environments, 1e-4));
  }
  // The most environments with which every setting can run the whole motion in each round.
  const double expected_sum = std::accumulate(expected.begin(), expected.end(), 0.0);
  const double round_time = options.budget / rounds;
  const double simulated = static_cast<double>(samples) / samples_per_second;
  const double affordable = round_time / (expected_sum * simulated);
  if (result.environments == 0)
    result.environments = static_cast<int>(std::clamp(affordable, 1.0 * fewest_environments, 1.0 * most_environments)) /
                          fewest_environments * fewest_environments;

  const double shortest = std::min(0.01, round_time / 100.0);  // s; what is shorter measures noise
  // Round by round, so that a slow minute of the machine slows all settings alike.
  std::vector<std::vector<double>> costs(settings.size());
  double done = 0.0;
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < settings.size(); ++i) {
      const double share = expected[i] / expected_sum;
      costs[i].push_back(measure_cost(plans[i], settings[i].f64, samples, result.environments,
                                      std::max(share * round_time, shortest)));
      tick((done += share) / rounds);
    }
  for (std::size_t i = 0; i < settings.size(); ++i) result.points[i].cost = median(costs[i]);
  return result;
}

constexpr const char* names_of_table =
    "method,integrator,iterations,dt,precision,rms_error,coupling_error_max,cost_us_per_env_second,env_steps_per_"
    "second,"
    "faulted";

std::string csv_line(const ChartPoint& point) {
  const ChartSetting& setting = point.setting;
  return fmt::format("{},{},{},{},{},{},{},{},{},{}\n", to_string(setting.method), to_string(setting.integrator),
                     setting.iterations, 1.0 / setting.steps_per_second, setting.f64 ? "f64" : "f32", point.rms_error,
                     point.coupling_error_max, 1e6 * point.cost, setting.steps_per_second / point.cost,
                     point.faulted ? 1 : 0);
}

void write_csv(const std::string& path, bool with_names, const std::vector<ChartPoint>& points) {
  OutputFile file(path);
  if (with_names) file.write(std::string(names_of_table) + "\n");
  for (const ChartPoint& point : points) file.write(csv_line(point));
  file.close();
}

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.find(':') + 2, line.size()));
  return "unknown processor";
}

const char* unit_of(const Model& model) {
  for (const Joint& joint : model.joints)
    if (joint.kind == JointKind::prismatic) return "rad, m";
  return "rad";
}

// What the picture says beside the points, as JSON.
std::string caption(const Model& model, const Truth& truth, int environments, int samples) {
  const nlohmann::json caption = {
      {"model", model.name},
      {"cpu", cpu_name()},
      {"target", to_string(Batch<float>(compile(model), 1, {.threads = 1}).target())},
      {"joints", std::count_if(model.joints.begin(), model.joints.end(), [](const Joint& j) { return j.moves(); })},
      {"couplings", model.couplings.size()},
      {"loops", model.loops.size()},
      {"base", base_of(model)},
      {"environments", environments},
      {"seconds", static_cast<double>(samples) / samples_per_second},
      {"unit", unit_of(model)},
      {"truth_error", truth.error},
      {"truth_steps_per_second", truth.steps_per_second},
      {"largest_error", largest_error}};
  return caption.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::string last_line(std::string text) {
  while (text.ends_with('\n')) text.pop_back();
  return text.substr(text.rfind('\n') + 1);
}

void draw(const ChartOptions& options, const std::string& csv, const std::string& out, const std::string& caption) {
  const std::optional<std::string> python = find_python(options.python);
  if (!python) {
    const std::string who = options.python.empty() ? "no Python here has" : options.python + " does not have";
    fmt::print("picture  none: {} matplotlib (Debian: python3-matplotlib); name a Python that has it with --python\n",
               who);
    return;
  }
  std::error_code none;  // no such file: the least time there is
  const auto before = std::filesystem::last_write_time(out, none);
  const ProcessResult result = run_python(*python, chart_script, {csv, out, caption});
  if (result.status != 0)
    throw InputError(fmt::format("{}: {} could not draw it: {}", out, *python, last_line(result.errors)));
  if (std::filesystem::last_write_time(out, none) == before)
    throw InputError(
        fmt::format("{}: {} has drawn nothing; name a Python 3 with matplotlib by --python", out, *python));
  fmt::print("picture  {}\n", out);
}

void report(const Model& model, const Truth& truth, const std::vector<ChartPoint>& points) {
  double least = infinity;
  for (const ChartPoint& point : points) least = std::min(least, point.rms_error);
  const auto failed = std::count_if(points.begin(), points.end(),
                                    [](const ChartPoint& p) { return p.faulted || !(p.rms_error <= largest_error); });
  fmt::print("model    {}\n", model.name);
  fmt::print("truth    {} steps/s, f64, extrapolated; estimated error {:.1e}\n", truth.steps_per_second, truth.error);
  if (truth.error > std::max(predictable * least, 1e-6))
    fmt::print(
        "         (too large to tell the methods apart: small differences grow in this motion; use a shorter\n"
        "         --seconds, a gentler --state or a --drive)\n");
  fmt::print("points   {}, {} of them failed (faulted, or off by more than {:g})\n", points.size(), failed,
             largest_error);
}

// Prints the cheapest setting for each power of ten of error, as far as some setting reaches it and the truth can tell.
// A setting that is the cheapest for several powers is printed once, with the smallest.
void advise(const Truth& truth, const std::vector<ChartPoint>& points, const char* unit) {
  const double seconds = static_cast<double>(truth.positions.cols()) / samples_per_second;
  const ChartPoint* last = nullptr;
  int last_power = 0;
  const auto print_last = [&] {
    if (!last) return;
    fmt::print("advice   for 1e{} {} over {:g} s: {}, {} env-steps/s ({:.2g} us per simulated second), off by {:.1e}\n",
               last_power, unit, seconds, described(last->setting),
               with_prefix(last->setting.steps_per_second / last->cost), 1e6 * last->cost, last->rms_error);
  };
  for (int power = -1; power >= -12; --power) {
    const double tolerance = std::pow(10.0, power);
    if (tolerance < predictable_from * truth.error) break;
    const ChartPoint* best = nullptr;
    for (const ChartPoint& point : points)
      if (!point.faulted && point.rms_error <= tolerance && (!best || point.cost < best->cost)) best = &point;
    if (!best) break;
    if (best != last) print_last();
    last = best, last_power = power;
  }
  print_last();
}

// Draws what ranks have measured.
void draw_again(const ChartOptions& options, const std::string& out, int samples) {
  const std::string text = text_of(options.table), first_line = std::string(names_of_table) + "\n";
  if (!text.starts_with(first_line) || text.size() == first_line.size())
    throw InputError(fmt::format("{}: is no table of a chart: its first line should be {}, and rows should follow",
                                 options.table, names_of_table));
  const Model model = with_start(options, options.model.load(options.ignore, {out}).model);
  const Truth truth = find_truth(model, options.ignore, samples, [](double) {});
  draw(options, options.table, out, caption(model, truth, options.environments, samples));
}

void run(const ChartOptions& options) {
  const std::filesystem::path stem = std::filesystem::path(options.model.file).stem();
  const std::string out = options.out.empty() ? stem.string() + "_chart.svg" : options.out;
  const std::string csv = name_of_rank(
      "--csv", options.csv.empty() ? std::filesystem::path(out).replace_extension(".csv").string() : options.csv,
      options.rank);
  std::error_code ignored;
  keep_apart({options.model.file, options.state, options.table}, {out, csv});
  require_writable(csv), require_writable(out);  // a bad name should not cost the measurement
  const std::string extension = std::filesystem::path(out).extension().string();
  if ((extension != ".svg" && extension != ".png" && extension != ".pdf") || std::filesystem::is_fifo(out, ignored))
    throw InputError(fmt::format("{}: is no picture; give the name of a file that ends with .svg, .png or .pdf", out));
  if (options.seconds > longest_motion)
    throw InputError(
        fmt::format("--seconds: {} s is too long for a chart; give at most {}", options.seconds, longest_motion));
  const int samples = std::max(1, static_cast<int>(std::lround(options.seconds * samples_per_second)));
  if (!options.table.empty()) return draw_again(options, out, samples);

  const Model model = with_start(options, options.model.load(options.ignore, {out, csv}).model);

  Truth truth;
  Measured measured;
  {
    Progress progress(100.0, "%");
    truth =
        find_truth(model, options.ignore, samples, [&](double share) { progress.update(100.0 * truth_share * share); });
    measured = measure(options, model, truth,
                       [&](double share) { progress.update(100.0 * (truth_share + (1.0 - truth_share) * share)); });
  }
  write_csv(csv, options.rank.rank == 0, measured.points);
  report(model, truth, measured.points);
  advise(truth, measured.points, unit_of(model));
  fmt::print("table    {}\n", csv);
  if (options.rank.ranks > 1) return fmt::print("picture  none: --table draws the tables of all ranks as one\n");
  draw(options, csv, out, caption(model, truth, measured.environments, samples));
}

}  // namespace

void add_chart(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("chart", "Measures and draws error against cost of the methods on a model");
  const auto options = std::make_shared<ChartOptions>();
  options->model.add_to(*command);
  add_ignore(*command, options->ignore);
  command->add_option("--out", options->out, "The picture (default MODEL_chart.svg); .png and .pdf work too")
      ->type_name("FILE");
  CLI::Option* const csv =
      command->add_option("--csv", options->csv, "The table (default: the picture's name with .csv)")
          ->type_name("FILE");
  add_parsed(
      *command, "--seconds", options->seconds, [](const std::string& text) { return seconds_of(text, "--seconds"); },
      "Simulated time in s")
      ->type_name("T")
      ->default_str("1");
  command
      ->add_option("--envs", options->environments,
                   "Number of environments while cost is measured; 0: as many as the budget allows")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(0, 1 << 24));
  command->add_option("--budget", options->budget, "CPU time in s to spend on measuring cost")
      ->type_name("S")
      ->capture_default_str()
      ->check(number_from(0.01, 1e5));
  command->add_option("--state", options->state, "CSV of the start state, one row")->type_name("FILE");
  add_rank(*command, options->rank, "Measures the share of the settings that rank R of N has, and draws nothing");
  command->add_option("--table", options->table, "Draws this table, of all ranks, and measures nothing")
      ->type_name("FILE")
      ->check(CLI::ExistingFile)
      ->excludes(csv);
  command->add_option("--python", options->python, "A Python that has matplotlib")->type_name("PATH");
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
