// How one environment's velocities follow from its coordinates: S and dS/dt z of (M146), loops open.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <span>

#include "environment.h"
#include "lockstep/coordinates.h"
#include "model/trees.h"

namespace lockstep {

/// Throws UsageError where an environment has a hard coupling that is off, or soft there: its follower is no function
/// of the coordinates.
template <class S>
void check_couplings_hold(const Plan& plan, const StatePointers<S>& rows, std::span<const int> ids);

/// Velocities: the six of each floating root in the order of the views, then the dofs. Coordinates: the same six, then
/// open_coordinate_dofs().
template <class S>
class Coordinates {
 public:
  explicit Coordinates(const Plan& plan);

  /// For environment e, as it stands.
  void find(const StatePointers<S>& rows, int e);

  int count() const { return static_cast<int>(columns_.cols()) - 1; }
  int velocities() const { return static_cast<int>(columns_.rows()); }
  int velocity_of(int joint) const { return first_dof_ + program_.f64.dof[joint]; }
  auto shares() const { return columns_.leftCols(count()); }               ///< S, [velocities][coordinates]
  auto acceleration() const { return columns_.col(columns_.cols() - 1); }  ///< dS/dt z, [velocities]

 private:
  void find_spatial_tendons(const StatePointers<S>& rows, int e);

  const Program& program_;
  int first_dof_;
  std::vector<int> free_;  // coordinates that are dofs
  Trees trees_;
  Eigen::MatrixXd columns_;          // S, and beside it dS/dt z
  Eigen::MatrixXd of_ring_, right_;  // J_F and -J_I S of couplings that place their followers together
};

}  // namespace lockstep
