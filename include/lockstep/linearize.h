// What Batch::linearize() takes and gives. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "lockstep/actions.h"
#include "lockstep/coordinates.h"
#include "lockstep/enums.h"
#include "lockstep/plan.h"
#include "lockstep/query.h"

namespace lockstep {

/// One row of a field: see Batch::parameter().
struct ParameterRow {
  Parameter parameter;
  int row;
};

struct LinearizeOptions {
  int substeps = 1;  ///< steps of dt between the two states, >= 1
  /// By what inputs: position or velocity targets of Plan::driven_dofs(), or efforts of Plan::independent_dofs(). Not
  /// position_change.
  ActionKind inputs = ActionKind::position;
  std::vector<ParameterRow> parameters = {};  ///< of declared fields
  std::vector<Query> record = {};             ///< read after the step
  double step = 1e-6;  ///< of a difference, in (0, 0.1]: rad, m and their rates; of a parameter, relative to its size
};

/// Derivatives of one step of one environment, (M144). A state has the coordinates: positions of coordinate_dofs();
/// for each floating root its motion in its own axes, angular (rad), then linear (m); velocities of these dofs; for
/// each floating root its velocity.
struct Linearization {
  Fault fault = Fault::none;  ///< of the environment, or of a copy that was moved a little; all numbers are NaN then
  Eigen::MatrixXd state_by_state, state_by_input, state_by_parameter;
  Eigen::MatrixXd record_by_state, record_by_input, record_by_parameter;  ///< by rows of the queries
};

}  // namespace lockstep
