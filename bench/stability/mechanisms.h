// The mechanisms of the maps, all passive: gravity, springs of servos that stand still, damping. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep::stability {

/// One driven joint, and beside it on the base as many fingers as follow it, in turn with -1 and 1/2. The servo
/// (kp 10, kd 0.1) starts 0.5 rad from its target, the couplings without error.
Model hand(int followers);

/// A serial arm in gravity whose every joint mimics the one before, folded up at the start, without error.
Model chain_of_couplings(int couplings);

/// chain8 with q_A = gear_ratio q_B, the last four links mass_ratio times as heavy; starts without error and at rest.
Model geared_arm(double gear_ratio, double mass_ratio);

/// chain8 with a servo on joints 0, 1, 4 and 5, kd = kp / 1000, 0.3 rad from the targets.
Model driven_arm(double kp);

/// chain8 whose couplings start `error` rad off.
Model displaced_arm(double error);

/// A slider and four that follow it, 1 kg each, neither gravity nor damping, couplings of the natural frequency (Hz)
/// and damping ratio; the one is 0.1 m off, so that all couplings start with the same error, at rest.
Model soft_star(double frequency, double damping_ratio);

}  // namespace lockstep::stability
