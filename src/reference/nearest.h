// The minimum of a quadratic function under linear equations of several classes. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace lockstep::reference {

/// Asks for rows v = speeds.
struct Held {
  Eigen::MatrixXd rows;
  Eigen::VectorXd speeds;
};

struct Nearest {
  Eigen::VectorXd v;
  Eigen::VectorXd impulses;  ///< L of all rows, class by class: A v = p + rows^T L. Of least norm where rows depend
};

/// The v of least 1/2 v^T A v - p^T v that holds all classes, for a positive definite A. Where they contradict each
/// other an earlier one holds, and the rows of one class share the misses by least squares.
Nearest nearest(const Eigen::MatrixXd& a, const Eigen::VectorXd& momentum, const std::vector<Held>& classes);

}  // namespace lockstep::reference
