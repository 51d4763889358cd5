// The minimum of a strictly convex function that is quadratic in pieces. SPDX-License-Identifier: Apache-2.0
//
// A Curve is minus the derivative of one convex term: the impulse L at a speed u = direction . v. From left to right it
// never rises, and it is vertical where it holds a speed exactly. At the minimum of
//     1/2 v^T H v - p^T v + sum of the terms
// H v = p + sum of direction L, and each (u, L) is on its curve: (M54) for all rows at once.
#pragma once

#include <Eigen/Dense>
#include <vector>

namespace lockstep::reference {

/// A straight part of a curve. If it holds a speed, u + cfm L = value for L in [from, to]; if not, L = value for u in
/// [from, to].
struct Piece {
  bool holds;
  double value, cfm, from, to;
};

struct Curve {
  Eigen::VectorXd direction;
  std::vector<Piece> pieces;  ///< from the lowest speeds to the highest
};

/// The interval of (M54). lo = hi holds that speed.
std::vector<Piece> interval_pieces(double lo, double hi, double cfm);
/// The box of (M54), F > 0 and possibly infinite.
std::vector<Piece> box_pieces(double bias, double box, double cfm);

struct Convex {
  Eigen::MatrixXd hessian;   ///< H, symmetric and positive definite
  Eigen::VectorXd momentum;  ///< p
  std::vector<Curve> curves;
};

struct Minimum {
  Eigen::VectorXd v;
  Eigen::VectorXd impulses;  ///< L of each curve; not unique where curves depend on each other
  std::vector<int> pieces;   ///< the piece that each curve is on
};

/// Throws std::logic_error if there is no minimum, because curves that hold speeds contradict each other.
Minimum minimum(const Convex& problem);

/// The largest violation of the conditions above. Each is relative to the size of its terms; speeds below 1 count as 1.
double violation(const Convex& problem, const Minimum& found);

}  // namespace lockstep::reference
