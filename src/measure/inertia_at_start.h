// What compile() needs to know of the inertia at the model's start. SPDX-License-Identifier: Apache-2.0
//
// The kernels compute the mass matrix.
#pragma once

#include <vector>

#include "plan/program.h"

namespace lockstep {

/// The largest |lambda| of (M75), 1/s: of the linear motion about the model's start. For programs with explicit terms.
double largest_rate(const Program& program);

/// By coupling: 1 / (K_cc A_ff), the share of its follower's entry of A that elimination of all other velocities
/// leaves.
std::vector<double> first_joints_shares(const Program& program);

/// By coupling: the largest share (M97) of one of its joints, 0 for couplings that are no rows.
std::vector<double> largest_folded_shares(const Program& program);

}  // namespace lockstep
