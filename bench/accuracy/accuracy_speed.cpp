// Error against cost of integrators, step sizes and engines. SPDX-License-Identifier: Apache-2.0
//
// One core. All settings take turns, repeat by repeat, so that other work of the machine slows all alike. A row is one
// engine with its settings at one step size: RMS error of the joints over the first second, largest |C| in that second,
// errors of energy and momentum at its end, and CPU time per environment and simulated second. Robots are URDF files
// without their bounds, and start as `lockstep chart` starts them. Of the other engines only MuJoCo runs them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "../median.h"
#include "../peak.h"
#include "../peers/judgement.h"
#include "lockstep/error.h"
#include "lockstep/import.h"
#include "tool/chart_runs.h"
#include "tool/csv.h"
#include "tool/output.h"
#include "tool/progress.h"

namespace lockstep::peers {
namespace {

struct Choices {
  std::vector<std::string> scenes = {"chain8", "gripper13", "chain32"}, robots;
  ImportOptions import;  // of the robots
  std::string csv;
  int repeats = 5;
  double seconds = 0.02;
  bool quick = false;
};

struct Point {
  Contender contender;
  int rate;  // steps per second
};

// The other engines run at 1/240 s and below, down to where they cost too much to be of interest.
std::vector<Point> points(bool quick, bool robots) {
  std::vector<Point> all;
  const auto add = [&](const std::vector<Contender>& contenders, std::initializer_list<int> rates) {
    for (const Contender& contender : contenders)
      for (const int rate : rates)
        if (!quick || rate == 240) all.push_back({contender, rate});
  };
  add(own_integrators(), {60, 120, 240, 480, 960, 1920});
#ifdef LOCKSTEP_PEER_MUJOCO
  add(mujoco_contenders(), {240, 480, 960, 1920, 3840});
#endif
  if (robots) return all;
#ifdef LOCKSTEP_PEER_BULLET
  add(bullet_contenders(), {240, 960, 3840});
#endif
#ifdef LOCKSTEP_PEER_SIMBODY
  add(simbody_contenders(), {240, 960});
#endif
  return all;
}

Model smooth(const std::string& file, const ImportOptions& options) {
  Model model = import_urdf_file(file, options).model;
  for (Joint& joint : model.joints) {
    joint.lower = -infinity, joint.upper = infinity;
    joint.velocity_limit = joint.effort_limit = infinity;
    joint.friction = 0.0;
  }
  return tool::with_moving_start(std::move(model));
}

void measure(const Choices& choices, const std::vector<Point>& all, const Yardstick& yardstick,
             const std::function<void(const std::string&)>& write, tool::Progress& progress, double& done) {
  std::vector<Verdict> verdicts;
  std::vector<std::vector<double>> rates(all.size());
  for (const Point& point : all) {
    Verdict verdict;
    try {
      verdict = judge(point.contender, yardstick, 1.0, 1.0, point.rate);
    } catch (const SettingsError&) {  // a servo is too stiff for an explicit integrator: no row
      verdict.rms = -1.0;
    }
    verdicts.push_back(verdict);
  }
  std::vector<double> peaks;
  for (int repeat = 0; repeat < choices.repeats; ++repeat) {
    peaks.push_back(bench::measured_peak(bench::Peak::avx2_f32));
    for (std::size_t i = 0; i < all.size(); ++i) {
      progress.update(++done);
      if (!(verdicts[i].rms >= 0.0)) continue;
      Stopwatch watch(all[i].contender, yardstick, all[i].rate);
      rates[i].push_back(watch.measure(choices.seconds, choices.seconds));
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (rates[i].empty()) continue;
    const double speed = bench::median(rates[i]);
    write(fmt::format("{},{},{},{},{:.3e},{:.2e},{:.2e},{:.2e},{:d},{:.4g},{:.0f},{:.3f},{:.1f}\n",
                      tool::csv_field(all[i].contender.engine), yardstick.scene().name,
                      tool::csv_field(all[i].contender.settings), all[i].rate, verdicts[i].rms, verdicts[i].largest_c,
                      verdicts[i].energy, verdicts[i].momentum, verdicts[i].diverged, 1e6 * all[i].rate / speed, speed,
                      bench::spread(rates[i]), bench::median(peaks)));
  }
}

int run(const Choices& choices) {
  const std::vector<Point> all = points(choices.quick, false), of_robots = points(choices.quick, true);
  std::unique_ptr<tool::OutputFile> file;
  if (!choices.csv.empty()) file = std::make_unique<tool::OutputFile>(choices.csv);
  const auto write = [&](const std::string& line) { file ? file->write(line) : fmt::print("{}", line); };
  write(
      "engine,scene,settings,steps_per_second,rms,largest_c,energy_error,momentum_change,diverged,"
      "cost_us_per_env_second,env_steps_per_second,spread,peak_gflops\n");
  const auto settings = choices.scenes.size() * all.size() + choices.robots.size() * of_robots.size();
  tool::Progress progress(static_cast<double>(settings) * choices.repeats, "measurements");
  double done = 0.0;
  for (const std::string& scene : choices.scenes)
    measure(choices, all, Yardstick(scene, choices.quick ? 24 : 240), write, progress, done);
  for (const std::string& robot : choices.robots)
    measure(choices, of_robots, Yardstick(smooth(robot, choices.import), choices.quick ? 24 : 240), write, progress,
            done);
  if (file) file->close();
  return 0;
}

}  // namespace
}  // namespace lockstep::peers

int main(int argc, char** argv) {
  lockstep::peers::Choices choices;
  CLI::App app("Measures error against cost of integrators, step sizes and engines.", "accuracy_speed");
  app.add_option("--csv", choices.csv, "File for the table (default: standard output)");
  app.add_option("--scenes", choices.scenes, "Measures these scenes alone")->delimiter(',');
  app.add_option("--robots", choices.robots, "Measures these URDF files too")->delimiter(',');
  app.add_option("--least-mass", choices.import.least_mass, "Least mass of the robots' bodies, kg");
  app.add_option("--least-inertia", choices.import.least_inertia,
                 "Least principal moments of the robots' bodies, kg m^2");
  app.add_option("--repeats", choices.repeats, "Number of measurements; the table has medians")->capture_default_str();
  app.add_option("--seconds", choices.seconds, "CPU time in s of each measurement")->capture_default_str();
  app.add_flag("--quick", choices.quick, "Only tests that the program runs: one step size and a tenth of the motion");
  CLI11_PARSE(app, argc, argv);
  try {
    return lockstep::peers::run(choices);
  } catch (const std::exception& error) {
    fmt::print(stderr, "accuracy_speed: {}\n", error.what());
    return 1;
  }
}
