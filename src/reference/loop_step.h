// The step of semi-implicit Euler with closed loops, section 30 of docs/mathematics.md. SPDX-License-Identifier:
// Apache-2.0
#pragma once

#include "bounds.h"
#include "loops.h"
#include "step.h"

namespace lockstep::reference {

/// The rows of all loops in a step: J v + bias + cfm impulse = 0, with |impulse| up to h times the limit.
struct LoopTargets {
  LoopRows rows;
  Eigen::VectorXd bias, cfm, box;  ///< by row; an infinite box has no limit
};
/// erp C / h, of hard ones at most 3 m/s or rad/s, and half the step's share of dJ/dt v. Without the former in the
/// velocity phase of hard ones where it is above 0.1 m/s or rad/s. Throws SettingsError for a Frequency, which has no
/// inertia here.
LoopTargets loop_targets(const Mechanism& mechanism, const Stage& stage, Phase phase);

/// True if a loop yields, or slips beyond a limit.
bool has_yielding_loops(const Model& model);

/// The step without bounds, of loops that are hard and have no limit. Hard couplings hold before loops.
Solution with_loops(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings);

}  // namespace lockstep::reference
