// All couplings at once: (K + diag cfm) L = -(J v* + b). SPDX-License-Identifier: Apache-2.0
#include "step.h"

namespace lockstep::reference {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Rows without an impulse have 1 on the diagonal and 0 elsewhere.
VectorXd solve(const Stage& stage, const VectorXd& b) {
  MatrixXd matrix = stage.response;
  VectorXd right = -(stage.jacobian * stage.free + b);
  for (int i = 0; i < right.size(); ++i) {
    matrix(i, i) += stage.rows[i].cfm;
    if (stage.rows[i].active) continue;
    matrix.row(i).setZero();
    matrix.col(i).setZero();
    matrix(i, i) = 1.0;
    right[i] = 0.0;
  }
  return matrix.llt().solve(right);
}

}  // namespace

Solution direct(const Stage& stage, const StepSettings& settings) {
  const auto velocity = [&](const VectorXd& impulses) -> VectorXd {
    return stage.free + stage.inverse * stage.jacobian.transpose() * impulses;
  };
  VectorXd impulses = solve(stage, stage.correction);
  const VectorXd position_velocity = velocity(impulses);
  if (settings.velocity_iterations == 0) return {position_velocity, position_velocity, impulses};

  VectorXd b = stage.correction;
  for (int i = 0; i < b.size(); ++i)
    if (stage.rows[i].hard) b[i] = 0.0;
  impulses = solve(stage, b);
  return {position_velocity, velocity(impulses), impulses};
}

}  // namespace lockstep::reference
