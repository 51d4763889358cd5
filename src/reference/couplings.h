// Couplings of the reference: Jacobian, error, softness, rank. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "mechanism.h"
#include "model/softness_numbers.h"

namespace lockstep::reference {

/// (17) for all couplings of a model: C = J q + gamma.
struct Couplings {
  /// `off` are couplings that shall not act, as flags by coupling; empty: all act.
  explicit Couplings(const Mechanism& mechanism, const std::vector<bool>& off = {});

  int count() const { return static_cast<int>(gamma.size()); }
  Eigen::VectorXd error(const Eigen::VectorXd& q) const { return jacobian * q + gamma; }
  /// J over all generalised velocities: zero for a floating root's six.
  Eigen::MatrixXd velocity_jacobian() const;

  Eigen::MatrixXd jacobian;  ///< [couplings][dofs]
  Eigen::VectorXd gamma;     ///< [couplings]
  std::vector<Softness> softness;
  std::vector<double> force_limit;
  std::vector<bool> off;
  /// Hard rows that depend linearly on earlier hard rows. They take no impulse. Couplings that are off or that can
  /// slip neither make others redundant nor are redundant themselves.
  std::vector<bool> redundant;

 private:
  int velocities_;
};

/// Spring constants of a coupling, (26) and (27) for frequencies. An ErpCfm means different springs at
/// different steps; they are the ones that (22), (23) give it at steps of h. Not for hard ones.
struct SpringConstants {
  double kp, kd;
};
SpringConstants spring(const Softness& softness, double r, double h);

/// A coupling as a row of the solver.
struct Row {
  bool active;           ///< takes an impulse: neither absent (kp = kd = 0), nor redundant, nor off
  bool hard;             ///< cfm = 0
  double erp, cfm;       ///< per step
  bool limited = false;  ///< in its force: a bounded row, bounds.h, and none of the couplings' rows
};

/// erp and cfm at steps of h, (22), (23), (26) to (29); `r` is the inverse of the inertia that the coupling feels.
Row row(const Softness& softness, double r, double h);

/// The same at each of n sub-steps of h. The n shares of a hard row's error that are corrected make up its erp.
Row substep_row(const Softness& softness, double r, double h, int n);

/// r of (19) for each coupling alone, with the mass matrix that it is given.
Eigen::VectorXd inverse_inertias(const Couplings& couplings, const Eigen::MatrixXd& mass);

}  // namespace lockstep::reference
