// Temporal Gauss-Seidel: one sweep (16) in each of N sub-steps, with a new C. SPDX-License-Identifier: Apache-2.0
#include "step.h"

namespace lockstep::reference {

using Eigen::VectorXd;

// A and all responses are those of the whole step.
Solution tgs(const Stage& stage, const StepSettings& settings) {
  const int n = settings.iterations, count = stage.couplings.count();
  const double h = stage.h / n;
  std::vector<Row> rows = stage.rows;
  for (int i = 0; i < count; ++i)
    if (rows[i].active) rows[i] = substep_row(stage.couplings.softness[i], stage.inertia[i], stage.h, n);

  VectorXd q = stage.state.q, v = stage.state.v;
  VectorXd velocity_sum = VectorXd::Zero(v.size()), impulse_sum = VectorXd::Zero(count);
  VectorXd b(count), impulses(count);
  for (int substep = 0; substep < n; ++substep) {
    v += (stage.free - stage.state.v) / n;
    impulse_sum += substep == 0 ? VectorXd::Zero(count) : impulses;
    impulses.setZero();
    const VectorXd error = stage.couplings.error(q);
    for (int i = 0; i < count; ++i) {
      b[i] = rows[i].erp * error[i] / h;
      if (rows[i].active) visit(stage, i, b[i], rows[i].cfm, impulses[i], v);
    }
    q += h * v.tail(q.size());
    velocity_sum += v;
  }

  velocity_sweeps(stage, settings.velocity_iterations, rows, b, impulses, v);
  return {velocity_sum / n, v, impulse_sum + impulses};
}

}  // namespace lockstep::reference
