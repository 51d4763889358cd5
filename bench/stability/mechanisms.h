// The mechanisms of the maps. SPDX-License-Identifier: Apache-2.0
//
// All are passive: gravity, springs of servos that stand still, damping. So their energy has a bound.
#pragma once

#include "lockstep/model.h"

namespace lockstep::stability {

/// One driven joint, and beside it on the base as many like it that follow it, in turn with the multipliers 1 and
/// -1/2. The servo (kp 1, kd 0) starts 0.5 rad from its target, the couplings without error; damping is slight.
Model hand(int followers);

/// A serial arm in gravity whose every joint mimics the one before, folded up at the start, without error.
Model chain_of_couplings(int couplings);

/// chain8 with q_A = gear_ratio q_B, the last four links mass_ratio times as heavy; starts without error and at rest.
/// Damping, 0.02 for equal masses, grows with the mass that a joint carries: what is asked is whether couplings and
/// arithmetic bear the masses.
Model geared_arm(double gear_ratio, double mass_ratio);

/// chain8 with another damping, N m s/rad, of all joints: how far the integrator keeps energy.
Model damped_arm(double damping);

/// chain8 with a servo on its first joint, kd = kp / 1000, 0.3 rad from the target.
Model driven_arm(double kp);

/// chain8 whose couplings start `error` rad off.
Model displaced_arm(double error);

/// A slider and four that follow it, 1 kg each, neither gravity nor damping, couplings of the natural frequency (Hz)
/// and damping ratio; the one is 0.1 m off, so that all couplings start with the same error, at rest.
Model soft_star(double frequency, double damping_ratio);

}  // namespace lockstep::stability
