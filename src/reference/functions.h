// Followers that are functions of one joint, in the reference. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "mechanism.h"

namespace lockstep::reference {

struct FunctionValue {
  double value, slope, bend;  ///< f, f', f''
};
/// Polynomials by their powers, splines by the dense system of their second derivatives.
FunctionValue value_of(const Function& function, double x);

/// By coupling: whether it has a function, or follows hard a joint that does so.
std::vector<bool> curved(const Model& model);

/// The state with the first joints of curved couplings where the others have them, and their velocities.
State placed(const Mechanism& mechanism, State state);

/// What the velocities of followers gain in each second where all others are constant. 0 for all but followers.
Eigen::VectorXd curved_acceleration(const Mechanism& mechanism, const State& state);

}  // namespace lockstep::reference
