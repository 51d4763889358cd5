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

/// The x of least norm among those of least |A x - b|. What a pivot below the threshold, as a share of the largest,
/// would say is rounding; 0 for Eigen's own.
Eigen::VectorXd least_norm(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double threshold = 0.0);

}  // namespace lockstep::reference
