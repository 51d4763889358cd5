// Rows of one more condition than a coupling: limits, friction, drives. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>
#include <vector>

#include "lockstep/step.h"
#include "step.h"

namespace lockstep::reference {

/// A row of (M54): an interval, a box, or both.
struct BoundedRow {
  Eigen::VectorXd direction;             ///< u = direction . v
  double lo = -infinity, hi = infinity;  ///< the interval; lo = hi: u is prescribed
  double box = 0.0, bias = 0.0;          ///< F and b; F = 0: no box
  double cfm = 0.0;
  int dof = -1, coupling = -1;  ///< what it belongs to: one of them
};

enum class Phase { position, velocity };

/// When in a step rows are asked for: at its start, or at that of one of the sub-steps of tgs.
struct Moment {
  Phase phase;
  Eigen::VectorXd q;     ///< of the joints
  double elapsed = 0.0;  ///< since the start of the step, s
  int substeps = 1;      ///< how many the step has
};

/// The rows in the order in which sweeps visit them: per joint what is hard (limits, kinematic drive, friction: one
/// row), then the soft limits, then the soft kinematic drives, then the couplings with a force limit. Which there are
/// depends on the model and the switches alone, not on the moment.
std::vector<BoundedRow> bounded_rows(const Mechanism& mechanism, const Stage& stage, const Inputs& inputs,
                                     const Moment& moment);

/// The model without the bounds that a step shall leave out.
Model without(const Ignored& ignored, Model model);

/// Whether anything of section 12 is left in it then.
bool has_bounds(const Model& model, const Ignored& ignored);

}  // namespace lockstep::reference
