// SPDX-License-Identifier: Apache-2.0
#include "tolerance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "lockstep/error.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

template <class S>
auto setter(const Targets& targets) {
  return [&targets](long step, double dt, Batch<S>& batch) {
    if (const int row = targets.row_at(step, dt); row >= 0) targets.apply(row, batch);
  };
}

// Flops of a simulated second. They order the settings of one model well enough, and are the same on every machine.
double cost_of(const Plan& plan) { return static_cast<double>(plan.flops_per_step()) / plan.settings().dt; }

}  // namespace

Chosen choose_step(const Model& model, const StepSettings& settings, bool f64, double tolerance, double seconds,
                   const Targets& targets) {
  const TargetSetter set_targets{setter<float>(targets), setter<double>(targets)};
  const int samples = std::max(1, static_cast<int>(std::lround(std::min(seconds, probe_seconds) * samples_per_second)));
  const Truth truth = find_truth(
      model, settings.ignore, samples, [](double) {}, set_targets);
  if (truth.error > tolerance / 3.0)
    throw InputError(
        fmt::format("--tolerance: {:g} is too small: this motion is known to {:.1e} only; give a larger tolerance or "
                    "fewer --seconds",
                    tolerance, truth.error));
  std::optional<Chosen> best;
  double least = infinity, smallest_error = infinity;
  std::string last_refusal;
  for (ChartSetting setting : tolerance_settings(settings.method, f64, settings.ignore)) {
    if (settings.integrator != Integrator::automatic && setting.integrator != settings.integrator) continue;
    setting.iterations = settings.iterations;
    StepSettings tried = settings;
    tried.dt = 1.0 / setting.steps_per_second;
    tried.integrator = setting.integrator;
    std::optional<Plan> plan;
    try {
      plan = compile(model, tried);
    } catch (const SettingsError& error) {  // not for this scene, or not with this step
      last_refusal = error.what();
      continue;
    }
    const double cost = cost_of(*plan);
    if (cost >= least) continue;
    const ChartPoint point = measure_error(*plan, setting, truth, set_targets);
    smallest_error = std::min(smallest_error, point.rms_error);
    if (point.faulted || !(point.rms_error <= tolerance)) continue;
    least = cost;
    best = Chosen{setting, point.rms_error, static_cast<double>(samples) / samples_per_second};
  }
  if (smallest_error == infinity && !last_refusal.empty()) throw InputError("--tolerance: " + last_refusal);
  if (!best)
    throw InputError(
        fmt::format("--tolerance: no step reaches {:g}, and the best error is {:.1e}; give a larger "
                    "tolerance{}",
                    tolerance, smallest_error, f64 ? "" : " or --precision f64"));
  return *best;
}

}  // namespace lockstep::tool
