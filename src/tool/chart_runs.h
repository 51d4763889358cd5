// The runs behind a chart: error and cost of every method at every step size. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "lockstep/batch.h"

namespace lockstep::tool {

/// The settings that a point of the chart stands for.
struct ChartSetting {
  Method method;
  int iterations;  ///< 0 for direct and reduced, which do not sweep
  int steps_per_second;
  bool f64;
  Ignored ignore = {};  ///< bounds that are left out
  Integrator integrator = Integrator::euler;
};

/// The name of the integrator, or that of the method for Euler's steps: "leapfrog", "reduced".
std::string family(const ChartSetting& setting);
/// The setting in words: "leapfrog at 1/240 s in f32", "euler (pgs 4) at 1/240 s in f32".
std::string described(const ChartSetting& setting);

struct ChartPoint {
  ChartSetting setting;
  double rms_error = 0.0;           ///< of all joint positions over the samples, rad or m; infinite if faulted
  double coupling_error_max = 0.0;  ///< of couplings and loops over all steps; infinite if faulted
  double cost = 0.0;                ///< CPU seconds on one thread per environment and simulated second
  bool faulted = false;
};

/// Functions that write the drives' targets into a batch before step number `step`, whose length is `dt` seconds.
struct TargetSetter {
  std::function<void(long step, double dt, Batch<float>&)> f32;
  std::function<void(long step, double dt, Batch<double>&)> f64;
};

/// Every step size of the chart divides 1/60 s.
inline constexpr int samples_per_second = 60;

struct Trajectory {
  Eigen::ArrayXXd positions;  ///< [dofs][samples] of the joints, the first after 1/60 s
  double coupling_error_max = 0.0;
  Fault fault = Fault::none;
};

/// The trajectory in the limit of small steps, with an estimate of its error.
struct Truth {
  Eigen::ArrayXXd positions;
  double error = 0.0;        ///< rms, rad or m
  int steps_per_second = 0;  ///< of the finest run
};

/// The model with a start that moves. A model with a velocity keeps its start. In a model at rest every independent
/// joint gets a displacement of 0.3 rad (0.03 m) within its limits, and 1 rad/s (0.1 m/s). The first joints of
/// couplings follow.
Model with_moving_start(Model model);

/// The settings that a chart compares. A model without couplings has only one method.
std::vector<ChartSetting> chart_settings(const Model& model, const Ignored& ignore = {});

/// Every integrator at every step size, for one method and precision. `simulate --tolerance` chooses from these.
std::vector<ChartSetting> tolerance_settings(Method method, bool f64, const Ignored& ignore);

double rms(const Eigen::ArrayXXd& difference);

/// Richardson extrapolation over runs with small steps in f64 and the automatic method: two runs of the integrator
/// `extrapolated`, or three of Euler where the scene has bounds. `tick` gets the share that is done. Throws InputError
/// where a run faults.
Truth find_truth(const Model& model, const Ignored& ignore, int samples, const std::function<void(double)>& tick,
                 const TargetSetter& targets = {});

/// The error of a setting against the truth. The cost stays 0.
ChartPoint measure_error(const Plan& plan, const ChartSetting& setting, const Truth& truth,
                         const TargetSetter& targets = {});

/// CPU seconds per environment and simulated second, on one thread. Measures for `seconds` > 0, and starts the motion
/// anew after `samples`.
double measure_cost(const Plan& plan, bool f64, int samples, int environments, double seconds);

Plan compile_setting(const Model& model, const ChartSetting& setting);

}  // namespace lockstep::tool
