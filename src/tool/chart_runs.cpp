// SPDX-License-Identifier: Apache-2.0
#include "chart_runs.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "state.h"
#include "tool.h"

namespace lockstep::tool {
namespace {

constexpr double start_angle = 0.3, start_slide = 0.03;     // rad, m
constexpr double start_turning = 1.0, start_sliding = 0.1;  // rad/s, m/s
constexpr int sweep_counts[] = {1, 2, 4, 8, 16, 32};
constexpr int step_rates[] = {60, 120, 240, 480, 960};
constexpr int tolerance_rates[] = {60, 120, 180, 240, 360, 480, 720, 960, 1440, 1920, 2880, 3840, 5760, 7680};
// Step rates of the truth, which takes the largest that fits its time. Each is a multiple of the sample rate.
constexpr int finest_truth = 60 * 2048, coarsest_truth = 60 * 128;
constexpr int finest_smooth_truth = 60 * 512, coarsest_smooth_truth = 60 * 32;
constexpr double truth_seconds = 6.0;  // of CPU time, for all runs of the truth

double thread_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

// The position plus or minus `by`, stopped by the limits: the one that is farther away.
double moved_within_limits(const Joint& joint, double by) {
  const double up = std::min(joint.position + by, std::max(joint.upper, joint.position));
  const double down = std::max(joint.position - by, std::min(joint.lower, joint.position));
  return up - joint.position >= joint.position - down ? up : down;
}

void set_targets(const TargetSetter& targets, long step, double dt, Batch<float>& batch) {
  if (targets.f32) targets.f32(step, dt, batch);
}
void set_targets(const TargetSetter& targets, long step, double dt, Batch<double>& batch) {
  if (targets.f64) targets.f64(step, dt, batch);
}

template <class S>
Trajectory trajectory(const Plan& plan, int samples, const std::function<void(double)>& tick, bool watch_couplings,
                      const TargetSetter& targets) {
  Batch<S> batch(plan, 1, {.threads = 1});
  const double dt = plan.settings().dt;
  const int substeps = static_cast<int>(std::lround(1.0 / (samples_per_second * dt)));
  const bool has_targets = targets.f32 || targets.f64,
             watched = watch_couplings && (plan.couplings() > 0 || !plan.loops().empty());
  Trajectory result;
  result.positions.resize(plan.dofs(), samples);
  for (int sample = 0; sample < samples; ++sample) {
    for (int step = 0; (has_targets || watched) && step < substeps; ++step) {
      set_targets(targets, static_cast<long>(sample) * substeps + step, dt, batch);
      batch.step();
      if (!watched) continue;
      for (const auto& errors : {batch.coupling_errors(), batch.loop_errors()})
        if (errors.rows() > 0)
          result.coupling_error_max = std::max(result.coupling_error_max, static_cast<double>(errors.abs().maxCoeff()));
    }
    if (!has_targets && !watched) batch.step(substeps);
    result.positions.col(sample) = batch.positions().col(0).template cast<double>();
    if (batch.faulted() > 0) break;
    tick((sample + 1.0) / samples);
  }
  result.fault = batch.faults()[0];
  return result;
}

Plan truth_plan(const Model& model, const Ignored& ignore, Integrator integrator, int steps_per_second) {
  StepSettings settings;
  settings.ignore = ignore;
  settings.integrator = integrator;
  settings.dt = 1.0 / steps_per_second;
  return compile(model, settings);
}

// The integrator of the truth: of a higher order where the model allows it, as that costs less.
Integrator truth_integrator(const Model& model, const Ignored& ignore) {
  try {
    truth_plan(model, ignore, Integrator::extrapolated, coarsest_truth);
    return Integrator::extrapolated;
  } catch (const SettingsError&) {
    return Integrator::euler;
  }
}

// The largest step rate that fits the time for the truth, which also runs at half of it and so on.
int truth_rate(const Model& model, const Ignored& ignore, Integrator integrator, int samples) {
  const bool smooth = integrator != Integrator::euler;
  int rate = smooth ? finest_smooth_truth : finest_truth;
  Batch<double> batch(truth_plan(model, ignore, integrator, rate), 1, {.threads = 1});
  constexpr int steps = 256;
  batch.step(steps);
  const double start = thread_seconds();
  batch.step(steps);
  const double per_step = (thread_seconds() - start) / steps;
  const double simulated = static_cast<double>(samples) / samples_per_second;
  const int coarsest = smooth ? coarsest_smooth_truth : coarsest_truth;
  while (rate > coarsest && 1.75 * rate * simulated * per_step > truth_seconds) rate /= 2;
  return rate;
}

// CPU seconds per environment and simulated second. Repeats the charted motion until the time is spent.
template <class S>
double cost(const Plan& plan, int samples, int environments, double seconds) {
  constexpr int block = 16;  // steps between two readings of the clock, which take time
  const int steps = static_cast<int>(std::lround(samples / (samples_per_second * plan.settings().dt)));
  Batch<S> batch(plan, environments, {.threads = 1});
  batch.step();  // maps the memory, before the clock runs
  double spent = 0.0;
  long taken = 0;
  while (spent < seconds) {
    batch.reset();
    for (int done = 0; done < steps && spent < seconds; done += block) {
      const int count = std::min(block, steps - done);
      const double start = thread_seconds();
      batch.step(count);
      spent += thread_seconds() - start;
      taken += count;
    }
  }
  return spent / static_cast<double>(taken) / environments / plan.settings().dt;
}

}  // namespace

Model with_moving_start(Model model) {
  std::vector<Joint*> joints;
  bool moves =
      std::any_of(model.roots.begin(), model.roots.end(), [](const Root& r) { return !r.velocity.isZero(0.0); });
  for (Joint& joint : model.joints)
    if (joint.moves()) joints.push_back(&joint), moves = moves || joint.velocity != 0.0;
  if (moves) return model;
  Batch<double> start(compile(model), 1, {.threads = 1});
  for (const int dof : start.plan().independent_dofs()) {
    const bool slides = joints[dof]->kind == JointKind::prismatic;
    start.positions()(dof, 0) = moved_within_limits(*joints[dof], slides ? start_slide : start_angle);
    start.velocities()(dof, 0) = slides ? start_sliding : start_turning;
  }
  start.project(EnvironmentSet::all(), Couplings::all);
  for (std::size_t dof = 0; dof < joints.size(); ++dof) {
    joints[dof]->position = start.positions()(static_cast<Eigen::Index>(dof), 0);
    joints[dof]->velocity = start.velocities()(static_cast<Eigen::Index>(dof), 0);
  }
  return model;
}

std::string family(const ChartSetting& setting) {
  return setting.integrator == Integrator::euler ? to_string(setting.method) : to_string(setting.integrator);
}

std::string described(const ChartSetting& setting) {
  const bool sweeps = setting.method == Method::pgs || setting.method == Method::tgs;
  const std::string method = setting.method == Method::automatic ? ""
                             : sweeps ? fmt::format(" ({} {})", to_string(setting.method), setting.iterations)
                                      : fmt::format(" ({})", to_string(setting.method));
  return fmt::format("{}{} at 1/{} s in {}", to_string(setting.integrator), method, setting.steps_per_second,
                     setting.f64 ? "f64" : "f32");
}

std::vector<ChartSetting> chart_settings(const Model& model, const Ignored& ignore) {
  std::vector<ChartSetting> settings;
  const auto add = [&](Method method, int iterations, bool f64, Integrator integrator = Integrator::euler) {
    for (const int rate : step_rates) settings.push_back({method, iterations, rate, f64, ignore, integrator});
  };
  for (const bool f64 : {false, true}) {
    if (!model.couplings.empty()) add(Method::reduced, 0, f64);
    add(Method::direct, 0, f64);
    for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
      add(Method::automatic, 0, f64, integrator);
  }
  if (model.couplings.empty()) return settings;
  for (const Method method : {Method::pgs, Method::tgs})
    for (const int sweeps : sweep_counts) add(method, sweeps, false);
  return settings;
}

std::vector<ChartSetting> tolerance_settings(Method method, bool f64, const Ignored& ignore) {
  std::vector<ChartSetting> settings;
  for (const Integrator integrator :
       {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated, Integrator::runge_kutta})
    for (const int rate : tolerance_rates) settings.push_back({method, 0, rate, f64, ignore, integrator});
  return settings;
}

double rms(const Eigen::ArrayXXd& difference) {
  return difference.size() == 0 ? 0.0 : std::sqrt(difference.square().mean());
}

Truth find_truth(const Model& model, const Ignored& ignore, int samples, const std::function<void(double)>& tick,
                 const TargetSetter& targets) {
  const Integrator integrator = truth_integrator(model, ignore);
  const int levels = integrator == Integrator::euler ? 3 : 2;
  const int rate = truth_rate(model, ignore, integrator, samples);
  Eigen::ArrayXXd runs[3];
  double done = 0.0;
  for (int level = 0; level < levels; ++level) {
    // Each run takes twice the steps of the one before.
    const double share = std::ldexp(1.0 / (2.0 - std::ldexp(1.0, 1 - levels)), level + 1 - levels);
    const Plan plan = truth_plan(model, ignore, integrator, rate >> (levels - 1 - level));
    Trajectory run = trajectory<double>(
        plan, samples, [&](double of_run) { tick(done + share * of_run); }, false, targets);
    if (run.fault != Fault::none)
      throw InputError(
          fmt::format("model '{}': the run with small steps, from which errors are measured, faulted ({}); "
                      "give another start with --state",
                      model.name, to_string(run.fault)));
    runs[level] = std::move(run.positions);
    done += share;
  }
  if (levels == 2) {
    // The error is c3 h^3 + ..., and extrapolation removes the first term. Stiff servos lower the order, at worst to
    // the first. The error that is left is then no more than the difference of the runs.
    const Eigen::ArrayXXd difference = runs[1] - runs[0];
    return {runs[1] + difference / 7.0, rms(difference), rate};
  }
  // The error is c1 h + c2 h^2 + ...: `coarse` and `fine` are without c1, and their extrapolation is without c2. The
  // estimate is the error of `fine`, which is more than the error that is left.
  const Eigen::ArrayXXd coarse = 2.0 * runs[1] - runs[0], fine = 2.0 * runs[2] - runs[1];
  return {(4.0 * fine - coarse) / 3.0, rms((fine - coarse) / 3.0), rate};
}

ChartPoint measure_error(const Plan& plan, const ChartSetting& setting, const Truth& truth,
                         const TargetSetter& targets) {
  const int samples = static_cast<int>(truth.positions.cols());
  const auto quiet = [](double) {};
  const Trajectory run = setting.f64 ? trajectory<double>(plan, samples, quiet, true, targets)
                                     : trajectory<float>(plan, samples, quiet, true, targets);
  ChartPoint point{.setting = setting};
  point.faulted = run.fault != Fault::none;
  point.rms_error = point.faulted ? infinity : rms(run.positions - truth.positions);
  point.coupling_error_max = point.faulted ? infinity : run.coupling_error_max;
  return point;
}

double measure_cost(const Plan& plan, bool f64, int samples, int environments, double seconds) {
  return f64 ? cost<double>(plan, samples, environments, seconds) : cost<float>(plan, samples, environments, seconds);
}

Plan compile_setting(const Model& model, const ChartSetting& setting) {
  StepSettings settings;
  settings.dt = 1.0 / setting.steps_per_second;
  settings.method = setting.method;
  settings.iterations = std::max(setting.iterations, 1);
  settings.ignore = setting.ignore;
  settings.integrator = setting.integrator;
  return compile(model, settings);
}

}  // namespace lockstep::tool
