// Bounded rows: limits, friction, kinematic drives, force limits. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "lockstep/step.h"
#include "step.h"

namespace lockstep::reference {

/// A row of (M54): an interval, a box, or both.
struct BoundedRow {
  Eigen::VectorXd direction;             ///< u = direction . v
  double lo = -infinity, hi = infinity;  ///< the interval; lo = hi holds u at that speed
  double box = 0.0, bias = 0.0;          ///< F and b; F = 0: no box
  double cfm = 0.0;
  int dof = -1, coupling = -1;  ///< the joint or the coupling that it belongs to; the other is -1
};

enum class Phase { position, velocity };

/// The moment in a step for which rows are made: its start, or the start of one of the sub-steps of tgs.
struct Moment {
  Phase phase;
  Eigen::VectorXd q;     ///< of the joints
  double elapsed = 0.0;  ///< since the start of the step, s
  int substeps = 1;      ///< of the step
};

/// The rows in the order in which sweeps visit them: one hard row for each joint (limits, kinematic drive, friction),
/// then the soft limits, then the soft kinematic drives, then the couplings with a force limit. The model and the
/// switches decide which rows there are; the moment does not.
std::vector<BoundedRow> bounded_rows(const Mechanism& mechanism, const Stage& stage, const Inputs& inputs,
                                     const Moment& moment);

/// The model without the ignored bounds.
Model without(const Ignored& ignored, Model model);

/// True if the model has bounds (section 12 of docs/mathematics.md) that are not ignored.
bool has_bounds(const Model& model, const Ignored& ignored);

}  // namespace lockstep::reference
