// What a scene's inertia says when compiling, by the kernels' own mass matrix at the model's start.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "plan/program.h"

namespace lockstep {

/// Of the scene's linear motion about its start, the largest |lambda| of (M75), 1/s. For programs whose terms are
/// explicit.
double largest_rate(const Program& program);

/// By coupling, what is left of its follower's entry of A when all that the coupling lets move is eliminated from it:
/// 1 / (K_cc A_ff).
std::vector<double> first_joints_shares(const Program& program);

}  // namespace lockstep
