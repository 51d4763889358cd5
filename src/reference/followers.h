// The part of the followers' velocities that corrects positions: w of (M39). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Dense>

#include "step.h"

namespace lockstep::reference {

/// w over all generalised velocities, zero but for the followers. What `reduced` eliminates are the couplings that are
/// hard in every environment: none where softness differs or couplings can be switched off.
Eigen::VectorXd follower_corrections(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings);

}  // namespace lockstep::reference
