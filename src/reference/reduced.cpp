// Hard couplings as exact constraints, with a basis of their null space. SPDX-License-Identifier: Apache-2.0
#include "nearest.h"
#include "step.h"

namespace lockstep::reference {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

struct Split {
  MatrixXd hard, soft;  // rows of J
  VectorXd hard_b, soft_b, soft_cfm;
  std::vector<int> hard_rows, soft_rows;  // their indices among all rows
};

Split split(const Stage& stage) {
  Split s;
  for (int i = 0; i < stage.couplings.count(); ++i)
    if (stage.rows[i].active) (stage.rows[i].hard ? s.hard_rows : s.soft_rows).push_back(i);
  s.hard = stage.jacobian(s.hard_rows, Eigen::all);
  s.soft = stage.jacobian(s.soft_rows, Eigen::all);
  s.hard_b = stage.correction(s.hard_rows);
  s.soft_b = stage.correction(s.soft_rows);
  s.soft_cfm.resize(s.soft_rows.size());
  for (std::size_t k = 0; k < s.soft_rows.size(); ++k) s.soft_cfm[k] = stage.rows[s.soft_rows[k]].cfm;
  return s;
}

// The velocity that minimises
//     1/2 |v - v*|^2_A + sum over the soft rows of (J v + b)^2 / (2 cfm)   subject to   J_hard v = -b_hard,
// and its impulses. Every v that the hard rows allow is w + N y, with N the null space of J_hard.
VectorXd constrained_minimum(const Stage& stage, const Split& s, const VectorXd& hard_b, VectorXd& impulses) {
  const MatrixXd& a = stage.implicit;
  VectorXd w = VectorXd::Zero(a.rows());
  MatrixXd null_space = MatrixXd::Identity(a.rows(), a.rows());
  if (hard_b.size() > 0) {
    w = -least_norm(s.hard, hard_b);
    // The last columns of Q in J^T P = Q R are orthogonal to all rows of J.
    const MatrixXd q = s.hard.transpose().colPivHouseholderQr().householderQ();
    null_space = q.rightCols(a.rows() - hard_b.size());
  }
  const VectorXd stiffness = s.soft_cfm.cwiseInverse();
  const MatrixXd hessian = a + s.soft.transpose() * stiffness.asDiagonal() * s.soft;
  const VectorXd downhill = a * (stage.free - w) - s.soft.transpose() * stiffness.cwiseProduct(s.soft * w + s.soft_b);
  const VectorXd y = (null_space.transpose() * hessian * null_space).ldlt().solve(null_space.transpose() * downhill);
  const VectorXd v = w + null_space * y;

  const VectorXd soft_impulses = -stiffness.cwiseProduct(s.soft * v + s.soft_b);
  impulses.setZero(stage.couplings.count());
  impulses(s.soft_rows) = soft_impulses;
  if (hard_b.size() > 0) {  // A (v - v*) = J^T L
    const VectorXd needed = a * (v - stage.free) - s.soft.transpose() * soft_impulses;
    impulses(s.hard_rows) = s.hard.transpose().colPivHouseholderQr().solve(needed);
  }
  return v;
}

}  // namespace

Solution reduced(const Stage& stage, const StepSettings& settings) {
  const Split s = split(stage);
  VectorXd impulses;
  const VectorXd position_velocity = constrained_minimum(stage, s, s.hard_b, impulses);
  if (settings.velocity_iterations == 0) return {position_velocity, position_velocity, impulses};
  const VectorXd velocity = constrained_minimum(stage, s, VectorXd::Zero(s.hard_b.size()), impulses);
  return {position_velocity, velocity, impulses};
}

}  // namespace lockstep::reference
