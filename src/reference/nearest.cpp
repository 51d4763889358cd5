// Pseudo-inverses, class by class, in the null space of the classes before. SPDX-License-Identifier: Apache-2.0
#include "nearest.h"

namespace lockstep::reference {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double dependence = 1e-9;  // singular values below this share of the rows' size are 0

}  // namespace

// With A = L L^T and y = L^T v, the function is 1/2 |y - L^-1 p|^2, and rows become B = rows L^-T.
Nearest nearest(const MatrixXd& a, const VectorXd& momentum, const std::vector<Held>& classes) {
  const Eigen::LLT<MatrixXd> factor(a);
  const VectorXd free = factor.matrixL().solve(momentum);
  VectorXd y = free;
  MatrixXd null_space = MatrixXd::Identity(y.size(), y.size()), all(0, y.size());
  for (const Held& held : classes) {
    if (held.speeds.size() == 0) continue;
    const MatrixXd b = factor.matrixL().solve(held.rows.transpose()).transpose();
    all.conservativeResize(all.rows() + b.rows(), Eigen::NoChange);
    all.bottomRows(b.rows()) = b;
    if (null_space.cols() == 0) continue;
    const Eigen::JacobiSVD<MatrixXd> svd(b * null_space, Eigen::ComputeThinU | Eigen::ComputeFullV);
    const Eigen::Index rank = (svd.singularValues().array() > dependence * b.norm()).count();
    const VectorXd missing = svd.matrixU().leftCols(rank).transpose() * (held.speeds - b * y);
    y += null_space * (svd.matrixV().leftCols(rank) * missing.cwiseQuotient(svd.singularValues().head(rank)));
    null_space = (null_space * svd.matrixV().rightCols(null_space.cols() - rank)).eval();
  }
  Nearest result{factor.matrixU().solve(y), VectorXd::Zero(all.rows())};
  if (all.rows() > 0) {
    result.impulses = least_norm(all.transpose(), y - free, dependence);
  }
  return result;
}

VectorXd least_norm(const MatrixXd& a, const VectorXd& b, double threshold) {
  Eigen::CompleteOrthogonalDecomposition<MatrixXd> factored;
  if (threshold > 0.0) factored.setThreshold(threshold);
  return factored.compute(a).solve(b);
}

}  // namespace lockstep::reference
