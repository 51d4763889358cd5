// Speed and errors of other engines and this library on the same mechanisms. SPDX-License-Identifier: Apache-2.0
//
// One core. All engines take turns, repeat by repeat, and the peak of the machine is measured in between. Other work of
// the machine slows code that waits for memory or branches more than it slows this library. So the table has the
// fastest repeat of the others, and the median of this library.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "../median.h"
#include "../peak.h"
#include "judgement.h"
#include "tool/csv.h"
#include "tool/output.h"
#include "tool/progress.h"

namespace lockstep::peers {
namespace {

struct Choices {
  std::vector<std::string> scenes = {"chain8", "gripper13", "chain32"};
  std::vector<std::string> engines;
  std::string csv;
  int repeats = 9;
  double seconds = 0.1, horizon = 5.0;
  bool quick = false;
};

std::vector<Contender> contenders(const std::vector<std::string>& engines) {
  std::vector<Contender> all = own_contenders();
  [[maybe_unused]] const auto add = [&](const std::vector<Contender>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
#ifdef LOCKSTEP_PEER_MUJOCO
  add(mujoco_contenders());
#endif
#ifdef LOCKSTEP_PEER_BULLET
  add(bullet_contenders());
#endif
#ifdef LOCKSTEP_PEER_SIMBODY
  add(simbody_contenders());
#endif
  const auto unwanted = [&](const Contender& contender) {
    return std::none_of(engines.begin(), engines.end(),
                        [&](const std::string& engine) { return contender.engine.starts_with(engine); });
  };
  if (!engines.empty()) std::erase_if(all, unwanted);
  return all;
}

using bench::median;
using bench::spread;

// True if every engine has the mechanism of the scene. Contenders with soft couplings cannot tell, and are left out.
bool same_mechanism(const Yardstick& yardstick, const std::vector<Contender>& all) {
  bool same = true;
  for (const Contender& contender : all) {
    if (!contender.exact) continue;
    const double distance = distance_at_small_steps(contender, yardstick);
    const bool fits = distance < 0.003;
    same = same && fits;
    fmt::print("{:10} {:14} {:36} off by {:7.1e} of the way{}\n", yardstick.scene().name, contender.engine,
               contender.settings, distance, fits ? "" : ": ANOTHER MECHANISM");
  }
  return same;
}

void compare(const Choices& choices, const std::vector<Contender>& all, const Yardstick& yardstick,
             const std::function<void(const std::string&)>& write, tool::Progress& progress, double& done) {
  std::vector<Verdict> verdicts;
  std::vector<Stopwatch> watches;
  for (const Contender& contender : all) {
    verdicts.push_back(judge(contender, yardstick, choices.horizon, 1.0));
    watches.emplace_back(contender, yardstick);
    watches.back().measure(0.01, 0.1);
  }
  std::vector<std::vector<double>> rates(all.size());
  std::vector<double> peaks;
  for (int repeat = 0; repeat < choices.repeats; ++repeat) {
    peaks.push_back(bench::measured_peak(bench::Peak::avx2_f32));
    for (std::size_t i = 0; i < all.size(); ++i) {
      rates[i].push_back(watches[i].measure(choices.seconds, 10.0 * choices.seconds));
      progress.update(++done);
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool own = all[i].engine == "lockstep";
    const double rate = own ? median(rates[i]) : *std::max_element(rates[i].begin(), rates[i].end());
    write(fmt::format("{},{},{},{:.0f},{:.3f},{:.2e},{:.2e},{:d},{:.1f}\n", tool::csv_field(all[i].engine),
                      yardstick.scene().name, tool::csv_field(all[i].settings), rate, spread(rates[i]), verdicts[i].rms,
                      verdicts[i].largest_c, verdicts[i].diverged, median(peaks)));
  }
}

int run(const Choices& choices) {
  const std::vector<Contender> all = contenders(choices.engines);
  std::unique_ptr<tool::OutputFile> file;
  if (!choices.csv.empty()) file = std::make_unique<tool::OutputFile>(choices.csv);
  const auto write = [&](const std::string& line) { file ? file->write(line) : fmt::print("{}", line); };
  if (!choices.quick) write("engine,scene,settings,steps_per_second,spread,rms,largest_c,diverged,peak_gflops\n");
  tool::Progress progress(static_cast<double>(choices.scenes.size() * all.size()) * choices.repeats, "measurements");
  bool same = true;
  double done = 0.0;
  for (const std::string& scene : choices.scenes) {
    const Yardstick yardstick(scene, choices.quick ? 12 : 240);
    if (choices.quick)
      same = same_mechanism(yardstick, all) && same;
    else
      compare(choices, all, yardstick, write, progress, done);
  }
  if (file) file->close();
  return same ? 0 : 1;
}

}  // namespace
}  // namespace lockstep::peers

int main(int argc, char** argv) {
  lockstep::peers::Choices choices;
  CLI::App app("Measures other engines and this library on the same mechanisms.", "peers");
  app.add_option("--csv", choices.csv, "File for the table (default: standard output)");
  app.add_option("--scenes", choices.scenes, "Measures these scenes alone")->delimiter(',');
  app.add_option("--engines", choices.engines, "Measures these alone: MuJoCo, Bullet, Simbody, lockstep")
      ->delimiter(',');
  app.add_option("--repeats", choices.repeats,
                 "Number of measurements; the table has the fastest of the others and the median of lockstep")
      ->capture_default_str();
  app.add_option("--seconds", choices.seconds, "Least CPU time in s of each measurement, which takes whole motions")
      ->capture_default_str();
  app.add_option("--horizon", choices.horizon, "Time in s over which the largest |C| is measured")
      ->capture_default_str();
  app.add_flag("--quick", choices.quick, "Measures nothing; tests that every engine has the same mechanism");
  CLI11_PARSE(app, argc, argv);
  try {
    return lockstep::peers::run(choices);
  } catch (const std::exception& error) {
    fmt::print(stderr, "peers: {}\n", error.what());
    return 1;
  }
}
