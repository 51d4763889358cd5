// The runs behind a chart: error and cost of every method at every step size. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/batch.h"

namespace lockstep::tool {

/// One way to step: what a point of the chart stands for.
struct ChartSetting {
  Method method;
  int iterations;  ///< 0 for direct and reduced, which have none
  int steps_per_second;
  bool f64;
  Ignored ignore = {};  ///< bounds that no run of the chart has
  Integrator integrator = Integrator::euler;
};

/// "leapfrog", or "reduced" for what is stepped by Euler; sweeps and precision apart.
std::string family(const ChartSetting& setting);
/// "leapfrog at 1/240 s in f32", "euler (pgs 4) at 1/240 s in f32".
std::string described(const ChartSetting& setting);

struct ChartPoint {
  ChartSetting setting;
  double rms_error = 0.0;           ///< of all joint positions over the samples, rad or m; infinite if faulted
  double coupling_error_max = 0.0;  ///< over all steps; infinite if faulted
  double cost = 0.0;                ///< CPU seconds on one thread per environment and simulated second
  bool faulted = false;
};

/// What is done with a batch before its step number `step`, of `dt` seconds: its targets.
struct Drive {
  std::function<void(long step, double dt, Batch<float>&)> f32;
  std::function<void(long step, double dt, Batch<double>&)> f64;
};

/// Samples are 1/60 s apart: every step size of the chart divides that.
inline constexpr int samples_per_second = 60;

/// Joint positions [dofs][samples], the first after 1/60 s.
struct Trajectory {
  Eigen::ArrayXXd positions;
  double coupling_error_max = 0.0;
  Fault fault = Fault::none;
};

/// The trajectory in the limit of small steps, with an estimate of what it is still off.
struct Truth {
  Eigen::ArrayXXd positions;
  double error = 0.0;        ///< rms, rad or m
  int steps_per_second = 0;  ///< the most that were taken
};

/// `model` with a start that moves. One that has a velocity keeps its own; in another every independent joint
/// is put 0.3 rad (0.03 m) off, within its limits, and turns at 1 rad/s (0.1 m/s); the others follow the couplings.
Model with_moving_start(Model model);

/// All that are to be compared. A model without couplings has nothing to solve and only one method.
std::vector<ChartSetting> chart_settings(const Model& model, const Ignored& ignore = {});

/// Every integrator at every step, for one method and precision: what `simulate --tolerance` chooses from.
std::vector<ChartSetting> tolerance_settings(Method method, bool f64, const Ignored& ignore);

double rms(const Eigen::ArrayXXd& difference);

/// Richardson extrapolation over runs of small steps, f64, method automatic: two of the extrapolated integrator (third
/// order), or three of Euler where the scene has bounds. `tick` is called now and then with the share that is done.
/// Throws InputError where the run faults.
Truth find_truth(const Model& model, const Ignored& ignore, int samples, const std::function<void(double)>& tick,
                 const Drive& drive = {});

/// Error of a setting against the truth; the cost stays 0.
ChartPoint measure_error(const Plan& plan, const ChartSetting& setting, const Truth& truth, const Drive& drive = {});

/// CPU seconds per environment and simulated second on this thread: `seconds` > 0 of the charted motion, which
/// starts anew after `samples`.
double measure_cost(const Plan& plan, bool f64, int samples, int environments, double seconds);

/// The plan of a setting.
Plan compile_setting(const Model& model, const ChartSetting& setting);

}  // namespace lockstep::tool
