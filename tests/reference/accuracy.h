// The error of a Batch against exact motion. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "lockstep/plan.h"
#include "physics.h"
#include "scenes/scenes.h"

namespace lockstep::physics {

/// The largest allowed error of a scene at 1/240 s: root mean square over all joints and the first second, rad. It is
/// the first-order error of semi-implicit Euler with exact couplings.
struct Bound {
  const char* scene;
  double rms;
};
constexpr Bound bounds[] = {{"chain8", 2.7e-3},  {"gripper13", 1.7e-3}, {"chain32", 1.2e-2},
                            {"gear100", 2.9e-3}, {"drive1e6", 2.9e-3},  {"redundant", 2.9e-3}};

/// Steps one environment of a scene and calls watch(step) after each step. Position targets are those at the start of
/// the step.
template <class S, class Watch>
void play(const scenes::Scene& scene, Batch<S>& batch, int steps, Watch&& watch) {
  const double dt = batch.plan().settings().dt;
  for (int step = 0; step < steps; ++step) {
    batch.position_targets().col(0) = scene.targets(step * dt).array().template cast<S>();
    batch.step();
    watch(step + 1);
  }
}

/// The error as in Bound, with `steps_per_row` steps per 1/240 s. `truth` has the positions of the exact motion: a row
/// every 1/240 s, the first at the start.
inline double rms_error(const std::string& name, Method method, int steps_per_row, const Eigen::MatrixXd& truth) {
  const scenes::Scene scene = scenes::scene(name);
  Batch<double> batch(compile(scene.model, settings(method, 4, 1, 1.0 / 240 / steps_per_row)), 1, {.threads = 1});
  double sum = 0.0;
  play(scene, batch, static_cast<int>(truth.rows() - 1) * steps_per_row, [&](int step) {
    if (step % steps_per_row == 0)
      sum += (batch.positions().col(0).matrix() - truth.row(step / steps_per_row).transpose()).squaredNorm();
  });
  return std::sqrt(sum / static_cast<double>(truth.size() - truth.cols()));
}

}  // namespace lockstep::physics
