// Closed loops of the reference: errors, Jacobian, and poses that close them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "mechanism.h"

namespace lockstep::reference {

/// The rows of all loops at a state, section 30 of docs/mathematics.md, loop by loop and along the axes of the first
/// frame, whose z is the axis of a hinge or a slider: first those that hold the origins, then those that hold the
/// directions.
struct LoopRows {
  Eigen::VectorXd error;     ///< C, m and rad
  Eigen::MatrixXd jacobian;  ///< J over all velocities: dC/dt = J v, for directions where the loop is closed
  Eigen::VectorXd bias;      ///< dJ/dt v, for twists of the roots that are constant along their own axes
  std::vector<int> loop;     ///< by row
  std::vector<bool> turns;   ///< by row: it holds a direction
};
LoopRows loop_rows(const Mechanism& mechanism, const State& state);

/// The state with its loops and hard couplings closed, by Newton's method with steps of least norm. Velocities stay.
/// Throws std::logic_error where it finds no such pose.
State closed(const Mechanism& mechanism, const State& state);

}  // namespace lockstep::reference
