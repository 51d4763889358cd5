// States of environments: columns in files, starts that satisfy the couplings. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "csv.h"
#include "lockstep/batch.h"

namespace lockstep::tool {

/// One number of an environment's state and the name of its column: NAME and NAME.v for a joint,
/// root.x ... root.vz for a floating root.
struct StateColumn {
  enum class Kind { position, velocity, root_pose, root_velocity };
  std::string name;
  Kind kind;
  int row;  ///< of the Batch view of that kind
};

/// NAME, NAME.v of every moving joint. Throws InputError where two columns would have the same name.
std::vector<StateColumn> joint_columns(const std::vector<std::string>& joints);
std::vector<StateColumn> root_columns();  ///< pose, then velocity, in the order of the Batch's rows

template <class S>
typename Batch<S>::View state_view(Batch<S>& batch, StateColumn::Kind kind);

/// Puts the rows of a state file into the environments: one row for all, or one each. What is not named
/// keeps its value. Throws InputError for unknown columns and numbers that cannot be used.
template <class S>
void apply_state(const Table& table, Batch<S>& batch);

/// The model with a start from a state file of one row.
Model with_state(Model model, const Table& table);

/// Makes states of one environment satisfy the couplings (17): by moving the couplings' first joints where
/// that is enough, else with the least motion of all.
class CouplingSolver {
 public:
  explicit CouplingSolver(const Model& model);

  /// By dof: whether it is no coupling's first joint.
  const std::vector<bool>& independent() const { return independent_; }
  void settle_positions(Eigen::VectorXd& positions) const;    ///< C = 0
  void settle_velocities(Eigen::VectorXd& velocities) const;  ///< dC/dt = 0

 private:
  void settle(Eigen::VectorXd& values, const Eigen::VectorXd& offsets) const;
  std::vector<bool> independent_;
  Eigen::MatrixXd jacobian_;  ///< [couplings][dofs]
  Eigen::VectorXd offsets_;
  Eigen::MatrixXd first_joints_, all_joints_;  ///< from errors to joint motions, pseudo-inverses
};

/// Adds normal noise of deviation `sigma` to the independent joints of every environment and settles the
/// couplings. Environment e gets the same noise whatever stands behind it.
template <class S>
void perturb(double sigma, std::uint64_t seed, Batch<S>& batch);

}  // namespace lockstep::tool
