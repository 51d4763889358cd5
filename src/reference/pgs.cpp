// Projected Gauss-Seidel, (16): rows one after the other on the velocity. SPDX-License-Identifier: Apache-2.0
#include "step.h"

namespace lockstep::reference {

using Eigen::VectorXd;

// q, and with it C and b, stay as they are at the start of the step.
Solution pgs(const Stage& stage, const StepSettings& settings) {
  VectorXd v = stage.free;
  VectorXd impulses = VectorXd::Zero(stage.couplings.count());
  for (int sweep = 0; sweep < settings.iterations; ++sweep)
    for (int i = 0; i < impulses.size(); ++i)
      if (stage.rows[i].active) visit(stage, i, stage.correction[i], stage.rows[i].cfm, impulses[i], v);

  const VectorXd position_velocity = v;
  velocity_sweeps(stage, settings.velocity_iterations, stage.rows, stage.correction, impulses, v);
  return {position_velocity, v, impulses};
}

Solution literal_18(const Stage& stage, const StepSettings& settings) {
  VectorXd v = stage.free;
  VectorXd impulses = VectorXd::Zero(stage.couplings.count());
  for (int sweep = 0; sweep < settings.iterations; ++sweep)
    for (int i = 0; i < impulses.size(); ++i) {
      if (!stage.rows[i].active) continue;
      double forgotten = 0.0;
      visit(stage, i, stage.correction[i], stage.rows[i].cfm, forgotten, v);
      impulses[i] += forgotten;
    }
  return {v, v, impulses};
}

}  // namespace lockstep::reference
