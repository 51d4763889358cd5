// Times each stage of a step on one tile, beside the machine's peak. SPDX-License-Identifier: Apache-2.0
//
// The program times the first n stages of a step for each n. A stage's time is what it adds, so the stages sum up to
// the step. Caches are hot, and the data are those of a real step. Times are medians over repeats in which all n take
// turns. A stage may add almost nothing if the processor starts it before the one before is finished.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <numeric>
#include <stdexcept>

#include "lockstep/plan.h"
#include "median.h"
#include "peak.h"
#include "plan/program.h"
#include "scenes/scenes.h"
#include "stage_kernels.h"
#include "tool/csv.h"
#include "tool/output.h"
#include "tool/progress.h"

namespace lockstep::bench {
namespace {

struct Choices {
  std::string csv;
  int repeats = 15;
  double seconds = 0.004;  // of CPU time for each number of stages, in each repeat
};

// State and inputs of one tile, the same in all lanes.
class TileState {
 public:
  TileState(const Plan& plan) : numbers_(rows * width), fault_(width, Fault{}) {
    batch_.stride = width;
    float* next = aligned();
    const auto take = [&](int count) { return std::exchange(next, next + count * width); };
    const int dofs = plan.dofs();
    batch_.position = take(dofs);
    batch_.velocity = take(dofs);
    batch_.angle = take(dofs);
    float* targets = take(dofs);
    batch_.position_target = targets;
    batch_.velocity_target = take(dofs);
    batch_.effort = take(dofs);
    const bool floats = !plan.root_names().empty();
    if (floats) batch_.root_pose = take(7), batch_.root_velocity = take(6);
    batch_.fault = fault_.data();
    for (int d = 0; d < dofs; ++d) {
      const Joint& joint = plan.model().joints[plan.model().joint_index(plan.dof_names()[d])];
      std::fill_n(batch_.position + d * width, width, static_cast<float>(joint.position));
      std::fill_n(batch_.velocity + d * width, width, static_cast<float>(joint.velocity));
      std::fill_n(targets + d * width, width, static_cast<float>(joint.drive.position_target));
    }
    if (floats) std::fill_n(batch_.root_pose + 3 * width, width, 1.0f);
  }
  const StatePointers<float>& batch() const { return batch_; }

 private:
  static constexpr int width = StageKernels::lanes, rows = 256;
  float* aligned() {
    void* begin = numbers_.data();
    std::size_t room = numbers_.size() * sizeof(float);
    return static_cast<float*>(std::align(64, 1, begin, room));
  }
  std::vector<float> numbers_;
  std::vector<Fault> fault_;
  StatePointers<float> batch_;
};

struct Times {
  std::vector<double> nanoseconds;  // by stage
  double peak = 0.0;                // Gflop/s
};

// Tables with which all stages run in full, even if followers are consistent.
Tables<float> tables_of(const Plan& plan) {
  Tables<float> tables = program_of(plan).f32;
  tables.reduction.consistent_is_shorter = false;
  return tables;
}

// Throws if the stages do not have the flops of a step, and so are no longer what a step runs.
void require_whole_step(const Plan& plan) {
  const TileState state(plan);
  const long counted = stage_flops(tables_of(plan), state.batch(), stage_count());
  if (counted != plan.flops_per_step())
    throw std::logic_error(fmt::format("the stages of {} have {} flops, but its step has {}", plan.model().name,
                                       counted, plan.flops_per_step()));
}

Times measure(const Plan& plan, const Choices& choices) {
  const Tables<float> t = tables_of(plan);
  const TileState start(plan), state(plan);
  const std::unique_ptr<void, void (*)(void*)> scratch(
      std::aligned_alloc(64, (StageKernels::scratch_bytes(t) + 63) / 64 * 64), std::free);
  const auto seconds = [&](int stages, long count) {
    const double before = cpu_seconds();
    StageKernels::run(t, start.batch(), state.batch(), scratch.get(), stages, count);
    return cpu_seconds() - before;
  };
  const int stages = stage_count();
  const double once = seconds(stages, 2000) / 2000;
  const long count = std::max(100l, std::lround(choices.seconds / once));
  std::vector<std::vector<double>> added(stages);
  std::vector<double> peaks;
  for (int repeat = 0; repeat < choices.repeats; ++repeat) {
    peaks.push_back(measured_peak(Peak::avx2_f32, choices.seconds));
    double before = seconds(0, count);
    for (int s = 0; s < stages; ++s) {
      if (!stage_present(t, s)) continue;
      const double now = seconds(s + 1, count);
      added[s].push_back(1e9 * (now - before) / static_cast<double>(count));
      before = now;
    }
  }
  Times times{std::vector<double>(stages, 0.0), median(peaks)};
  for (int s = 0; s < stages; ++s)
    if (!added[s].empty()) times.nanoseconds[s] = median(added[s]);
  return times;
}

int run(const Choices& choices) {
  std::unique_ptr<tool::OutputFile> file;
  if (!choices.csv.empty()) file = std::make_unique<tool::OutputFile>(choices.csv);
  const auto write = [&](const std::string& line) { file ? file->write(line) : fmt::print("{}", line); };
  write("scene,method,stage,ns_per_tile,flops,gflops,share_of_peak,peak_gflops\n");
  tool::Progress progress(9, "scenes and methods");
  double done = 0.0;
  for (const char* scene : {"chain8", "gripper13", "chain32"})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs}) {
      const Plan plan = compile(scenes::scene(scene).model, {.method = method, .integrator = Integrator::euler});
      const Tables<float> t = tables_of(plan);
      require_whole_step(plan);
      const Times times = measure(plan, choices);
      const TileState state(plan);
      const auto row = [&](const char* stage, double ns, long flops) {
        const double gflops = ns > 0 ? static_cast<double>(flops * StageKernels::lanes) / ns : 0.0;
        write(fmt::format("{},{},{},{:.1f},{},{:.1f},{:.3f},{:.1f}\n", scene, to_string(method), stage, ns, flops,
                          gflops, gflops / times.peak, times.peak));
      };
      for (int s = 0; s < stage_count(); ++s)
        if (stage_present(t, s))
          row(stage_name(s), times.nanoseconds[s],
              stage_flops(t, state.batch(), s + 1) - stage_flops(t, state.batch(), s));
      row("step", std::reduce(times.nanoseconds.begin(), times.nanoseconds.end()),
          stage_flops(t, state.batch(), stage_count()));
      progress.update(++done);
    }
  if (file) file->close();
  return 0;
}

}  // namespace
}  // namespace lockstep::bench

int main(int argc, char** argv) {
  lockstep::bench::Choices choices;
  CLI::App app("Times the stages of a step.", "stage_bench");
  app.add_option("--csv", choices.csv, "File for the table (default: standard output)");
  app.add_option("--repeats", choices.repeats, "Number of measurements; the table has medians")->capture_default_str();
  app.add_option("--seconds", choices.seconds, "CPU time in s of each measurement")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  if (!lockstep::bench::supported(lockstep::bench::Peak::avx2_f32)) {
    fmt::print(stderr, "stage_bench: nothing to measure, because this machine has no AVX2\n");
    return 0;
  }
  try {
    return lockstep::bench::run(choices);
  } catch (const std::exception& error) {
    fmt::print(stderr, "stage_bench: {}\n", error.what());
    return 1;
  }
}
