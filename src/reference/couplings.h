// Couplings of the reference: Jacobian, error, softness, rank. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "mechanism.h"
#include "model/softness_numbers.h"

namespace lockstep::reference {

/// (17) for all couplings of a model: C = J q + gamma. A function of a joint is its tangent at q.
struct Couplings {
  /// `off` has a flag for each coupling that is switched off; empty: none is. Without q, it is where the model starts.
  explicit Couplings(const Mechanism& mechanism, const std::vector<bool>& off = {}, const Eigen::VectorXd& q = {});

  int count() const { return static_cast<int>(gamma.size()); }
  Eigen::VectorXd error(const Eigen::VectorXd& q) const { return jacobian * q + gamma; }
  /// J over all generalised velocities: zero for a floating root's six.
  Eigen::MatrixXd velocity_jacobian() const;

  Eigen::MatrixXd jacobian;  ///< [couplings][dofs]
  Eigen::VectorXd gamma;     ///< [couplings]
  std::vector<Softness> softness;
  std::vector<double> force_limit;
  std::vector<bool> off;
  /// Hard rows that depend linearly on earlier hard rows. They take no impulse. Couplings that are off or have a force
  /// limit are never redundant and make no other redundant.
  std::vector<bool> redundant;

 private:
  int velocities_;
};

/// Spring constants of a soft coupling, (26) and (27) for a Frequency. An ErpCfm is a different spring at each step
/// size: here it is the one of (22), (23) at steps of h.
struct SpringConstants {
  double kp, kd;
};
SpringConstants spring(const Softness& softness, double r, double h);

/// A coupling as a row of the solver.
struct Row {
  bool active;           ///< takes an impulse: not redundant, not off, and not a spring of kp = kd = 0
  bool hard;             ///< cfm = 0
  double erp, cfm;       ///< per step
  bool limited = false;  ///< has a force limit: a bounded row (bounds.h), and not one of the couplings' rows
};

/// erp and cfm at steps of h, (22), (23), (26) to (29). `r` is the inverse of the coupling's effective inertia.
Row row(const Softness& softness, double r, double h);

/// The same for each of the n sub-steps of a step of h. Together they correct the share erp of a
/// hard row's error.
Row substep_row(const Softness& softness, double r, double h, int n);

/// r of (19) for each coupling by itself, with the given mass matrix.
Eigen::VectorXd inverse_inertias(const Couplings& couplings, const Eigen::MatrixXd& mass);

}  // namespace lockstep::reference
