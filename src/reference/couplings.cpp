// Couplings of the reference. SPDX-License-Identifier: Apache-2.0
#include "couplings.h"

#include <cmath>
#include <stdexcept>

#include "functions.h"
#include "lockstep/error.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A row depends on earlier rows if it is, without their span, shorter than this share of its length.
constexpr double dependence = 1e-9;

// Gram-Schmidt over the hard rows in order, twice for each row, so that the basis is orthonormal to rounding.
std::vector<bool> dependent_rows(const MatrixXd& jacobian, const std::vector<bool>& hard) {
  std::vector<bool> dependent(hard.size(), false);
  MatrixXd basis(jacobian.cols(), 0);
  for (Eigen::Index i = 0; i < jacobian.rows(); ++i) {
    if (!hard[i]) continue;
    VectorXd orthogonal = jacobian.row(i).transpose().normalized();
    for (int round = 0; round < 2; ++round) orthogonal -= basis * (basis.transpose() * orthogonal);
    dependent[i] = orthogonal.norm() < dependence;
    if (dependent[i]) continue;
    basis.conservativeResize(Eigen::NoChange, basis.cols() + 1);
    basis.rightCols(1) = orthogonal.normalized();
  }
  return dependent;
}

Row spring_row(const SpringConstants& spring, double h) {
  const double stiffness = h * spring.kp + spring.kd;
  if (stiffness == 0.0) return {false, false, 0.0, 0.0};
  return {true, false, h * spring.kp / stiffness, 1.0 / (h * stiffness)};  // (23), (22)
}

}  // namespace

Couplings::Couplings(const Mechanism& mechanism, const std::vector<bool>& switched_off, const VectorXd& q)
    : off(switched_off), velocities_(mechanism.velocities()) {
  const std::vector<Coupling>& all = mechanism.model().couplings;
  jacobian = MatrixXd::Zero(all.size(), mechanism.dofs());
  gamma.resize(all.size());
  off.resize(all.size(), false);
  std::vector<bool> hard;  // and on, without a force limit
  for (std::size_t i = 0; i < all.size(); ++i) {
    jacobian(i, mechanism.dof(all[i].joint)) = 1.0;
    for (const CouplingTerm& term : all[i].terms) jacobian(i, mechanism.dof(term.joint)) = term.ratio;
    gamma[i] = all[i].offset;
    if (all[i].function) {
      const int leader = mechanism.dof(all[i].terms[0].joint);
      const double x = (q.size() > 0 ? q : mechanism.initial_state().q)[leader];
      const FunctionValue f = value_of(*all[i].function, x);
      jacobian(i, leader) = -f.slope;
      gamma[i] = f.slope * x - f.value;
    }
    softness.push_back(all[i].softness);
    force_limit.push_back(all[i].force_limit);
    hard.push_back(is_hard(softness[i]) && !off[i] && force_limit[i] == infinity);
  }
  redundant = dependent_rows(jacobian, hard);
}

MatrixXd Couplings::velocity_jacobian() const {
  MatrixXd result = MatrixXd::Zero(jacobian.rows(), velocities_);
  result.rightCols(jacobian.cols()) = jacobian;
  return result;
}

SpringConstants spring(const Softness& softness, double r, double h) {
  const auto [first, second] = numbers_of(softness);
  switch (kind_of(softness)) {
    case SoftnessKind::spring: return {first, second};
    case SoftnessKind::frequency: return {first * first / r, 2.0 * first * second / r};  // (26), (27)
    default: return {first / (h * h * second), (1.0 - first) / (h * second)};            // from (22), (23)
  }
}

Row row(const Softness& softness, double r, double h) {
  if (kind_of(softness) == SoftnessKind::hard || kind_of(softness) == SoftnessKind::erp_cfm)
    return {true, is_hard(softness), numbers_of(softness).first, numbers_of(softness).second};
  return spring_row(spring(softness, r, h), h);
}

Row substep_row(const Softness& softness, double r, double h, int n) {
  if (!is_hard(softness)) return n == 1 ? row(softness, r, h) : spring_row(spring(softness, r, h), h / n);
  if (n > 1 && erp_of(softness) > 1.0)
    throw SettingsError("erp", "exceeds 1 in a coupling, and sub-steps cannot share such a correction",
                        "give 1 or less, or one iteration");
  return {true, true, 1.0 - std::pow(1.0 - erp_of(softness), 1.0 / n), 0.0};
}

VectorXd inverse_inertias(const Couplings& couplings, const MatrixXd& mass) {
  const MatrixXd j = couplings.velocity_jacobian();
  const Eigen::LLT<MatrixXd> factor(mass);
  VectorXd r(couplings.count());
  for (int i = 0; i < r.size(); ++i) r[i] = j.row(i).dot(factor.solve(j.row(i).transpose()));
  return r;
}

}  // namespace lockstep::reference
