// The part of the followers' velocities that corrects positions: w of (M39). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>

#include "step.h"

namespace lockstep::reference {

/// w over all generalised velocities, zero for all but the followers. `reduced` eliminates the couplings that are hard
/// in every environment: none if softness or the switches of couplings differ from environment to environment.
Eigen::VectorXd follower_corrections(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings);

}  // namespace lockstep::reference
