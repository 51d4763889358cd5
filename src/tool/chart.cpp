// lockstep chart: error against cost of the methods on one model, measured here and now. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "chart_runs.h"
#include "chart_script.h"
#include "lockstep/error.h"
#include "options.h"
#include "progress.h"
#include "python.h"
#include "state.h"
#include "text.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr double largest_error = 10.0;  // rad or m; beyond it a run has failed
constexpr int rounds = 5;               // cost measurements of every setting, far apart in time
constexpr double truth_share = 0.2;     // of the work, as the progress bar shows it

struct ChartOptions {
  ModelOptions model;
  std::string out, csv, python, state;
  int environments = 0;  // 0: by the size of the model
  double seconds = 1.0, budget = 30.0;
};

// Enough that a cost is stable, few enough that a large model's state stays in the cache.
int environment_count(const ChartOptions& options, const Model& model) {
  if (options.environments > 0) return options.environments;
  const int dofs = static_cast<int>(std::count_if(model.joints.begin(), model.joints.end(),
                                                  [](const Joint& joint) { return joint.moves(); }));
  return std::clamp(65536 / std::max(dofs, 1) / 64 * 64, 256, 4096);
}

// The model with its start from the file, or with one that moves.
Model with_start(const ChartOptions& options, Model model) {
  model.validate();
  if (options.state.empty()) return with_moving_start(std::move(model));
  Batch<double> batch(compile(model), 1, {.threads = 1});
  apply_state(read_csv(options.state), batch);
  int dof = 0;
  for (Joint& joint : model.joints)
    if (joint.moves()) {
      joint.position = batch.positions()(dof, 0);
      joint.velocity = batch.velocities()(dof++, 0);
    }
  if (model.root.floating) {
    const Eigen::ArrayXd pose = batch.root_poses().col(0);
    model.root.pose.translation() = pose.head<3>();
    model.root.pose.linear() = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).normalized().toRotationMatrix();
    model.root.velocity = batch.root_velocities().col(0).matrix();
  }
  return model;
}

// The settings that the model allows, and a line about each method that it does not.
std::vector<ChartSetting> possible_settings(const Model& model) {
  std::vector<ChartSetting> possible;
  Method refused = Method::automatic;
  for (const ChartSetting& setting : chart_settings(model)) {
    if (setting.method == refused) continue;
    try {
      compile_setting(model, setting);
      possible.push_back(setting);
    } catch (const SettingsError& error) {
      refused = setting.method;
      fmt::print("left out: {}: {}\n", name(setting.method), error.what());
    }
  }
  return possible;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

std::vector<ChartPoint> measure(const Model& model, int environments, double budget, const Truth& truth,
                                const std::function<void(double)>& tick) {
  const std::vector<ChartSetting> settings = possible_settings(model);
  std::vector<ChartPoint> points;
  std::vector<Plan> plans;
  for (const ChartSetting& setting : settings) {
    points.push_back(measure_error(model, setting, truth));
    plans.push_back(compile_setting(model, setting));
  }
  // Round by round, so that a slow minute of the machine falls on all settings alike.
  std::vector<std::vector<double>> costs(settings.size());
  const double work = static_cast<double>(settings.size()) * rounds, slice = budget / work;
  double done = 0.0;
  for (int round = 0; round < rounds; ++round)
    for (std::size_t i = 0; i < settings.size(); ++i) {
      costs[i].push_back(measure_cost(plans[i], settings[i], environments, slice));
      tick(++done / work);
    }
  for (std::size_t i = 0; i < settings.size(); ++i) points[i].cost = median(costs[i]);
  return points;
}

std::string csv_line(const ChartPoint& point) {
  const ChartSetting& setting = point.setting;
  return fmt::format("{},{},{},{},{},{},{},{},{}\n", name(setting.method), setting.iterations,
                     1.0 / setting.steps_per_second, setting.f64 ? "f64" : "f32", point.rms_error,
                     point.coupling_error_max, 1e6 * point.cost, setting.steps_per_second / point.cost,
                     point.faulted ? 1 : 0);
}

void write_csv(const std::string& path, const std::vector<ChartPoint>& points) {
  OutputFile file(path);
  file.write("method,iterations,dt,precision,rms_error,coupling_error_max,cost_us_per_env_second,"
             "env_steps_per_second,faulted\n");
  for (const ChartPoint& point : points) file.write(csv_line(point));
  file.close();
}

std::string cpu_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.find(':') + 2, line.size()));
  return "unknown processor";
}

// What the picture says beside the points.
std::string caption(const Model& model, const Truth& truth, int environments, int samples) {
  bool slides = false;
  for (const Joint& joint : model.joints) slides = slides || joint.kind == JointKind::prismatic;
  const nlohmann::json caption = {
      {"model", model.name},
      {"cpu", cpu_name()},
      {"target", name(Batch<float>(compile(model), 1, {.threads = 1}).target())},
      {"joints", std::count_if(model.joints.begin(), model.joints.end(), [](const Joint& j) { return j.moves(); })},
      {"couplings", model.couplings.size()},
      {"base", model.root.floating ? "floating" : "fixed"},
      {"environments", environments},
      {"seconds", static_cast<double>(samples) / samples_per_second},
      {"unit", slides ? "rad, m" : "rad"},
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
    fmt::print("picture  none: {} has no matplotlib (Debian: python3-matplotlib); name one that has with --python\n",
               options.python.empty() ? "no python3 here" : options.python);
    return;
  }
  const ProcessResult result = run_process({*python, "-c", chart_script, csv, out, caption});
  if (result.status != 0)
    throw InputError(fmt::format("{}: cannot be drawn by {}: {}", out, *python, last_line(result.errors)));
  fmt::print("picture  {}\n", out);
}

void run(const ChartOptions& options) {
  const std::filesystem::path stem = std::filesystem::path(options.model.file).stem();
  const std::string out = options.out.empty() ? stem.string() + "_chart.svg" : options.out;
  const std::string csv =
      options.csv.empty() ? std::filesystem::path(out).replace_extension(".csv").string() : options.csv;
  if (csv == out) throw InputError(fmt::format("--out: '{}' is the table's name; name the picture .svg, .png or .pdf", out));
  const int samples = std::max(1, static_cast<int>(std::lround(options.seconds * samples_per_second)));

  const Model model = with_start(options, options.model.load().model);
  const int environments = environment_count(options, model);
  OutputFile(csv).close();  // a bad name should not cost the measurement

  Truth truth;
  std::vector<ChartPoint> points;
  {
    Progress progress(100.0, "%");
    truth = find_truth(model, samples, [&](double share) { progress.update(100.0 * truth_share * share); });
    points = measure(model, environments, options.budget, truth, [&](double share) {
      progress.update(100.0 * (truth_share + (1.0 - truth_share) * share));
    });
  }
  write_csv(csv, points);
  const auto failed = std::count_if(points.begin(), points.end(),
                                    [](const ChartPoint& p) { return p.faulted || !(p.rms_error <= largest_error); });
  fmt::print("model    {}\n", model.name);
  fmt::print("truth    {} steps/s, f64, extrapolated; estimated error {:.1e}\n", truth.steps_per_second, truth.error);
  fmt::print("points   {}, {} of them failed (faulted, or off by more than {:g})\n", points.size(), failed, largest_error);
  fmt::print("table    {}\n", csv);
  draw(options, csv, out, caption(model, truth, environments, samples));
}

}  // namespace

void add_chart(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("chart", "Measures and draws error against cost of the methods on a model");
  const auto options = std::make_shared<ChartOptions>();
  options->model.add_to(*command);
  command->add_option("--out", options->out, "The picture (default MODEL_chart.svg); .png and .pdf work too")
      ->type_name("FILE");
  command->add_option("--csv", options->csv, "The table (default: the picture's name with .csv)")->type_name("FILE");
  add_parsed(*command, "--seconds", options->seconds,
             [](const std::string& text) { return seconds_of(text, "--seconds"); }, "Simulated time in s")
      ->type_name("T")->default_str("1");
  command->add_option("--envs", options->environments, "Environments while measuring cost; 0: by the model's size")
      ->type_name("N")->capture_default_str()->check(CLI::Range(0, 1 << 24));
  command->add_option("--budget", options->budget, "CPU seconds to spend on measuring cost")
      ->type_name("S")->capture_default_str()->check(CLI::Range(0.0, 1e5));
  command->add_option("--state", options->state, "CSV with the start state, one row")->type_name("FILE");
  command->add_option("--python", options->python, "A Python that has matplotlib")->type_name("PATH");
  command->callback([options, &exit_code] {
    run(*options);
    exit_code = fine;
  });
}

}  // namespace lockstep::tool
