// Projected Gauss-Seidel, (16): the rows correct the velocity one after the other. SPDX-License-Identifier: Apache-2.0
#include "step.h"

namespace lockstep::reference {

using Eigen::VectorXd;

// q, C and b are those at the start of the step.
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
      double increment = 0.0;
      visit(stage, i, stage.correction[i], stage.rows[i].cfm, increment, v);
      impulses[i] += increment;
    }
  return {v, v, impulses};
}

}  // namespace lockstep::reference
