// The mechanisms of the maps. SPDX-License-Identifier: Apache-2.0
//
// All are passive: they have gravity, damping, and servos with fixed targets. So their energy has a bound.
#pragma once

#include "lockstep/model.h"

namespace lockstep::stability {

/// A leader with a servo, and this many followers on the same base, with the multipliers 1 and -1/2 in turn. The servo
/// (kp 1, kd 0) starts 0.5 rad from its target, and the couplings start without error. Damping is slight.
Model hand(int followers);

/// A serial arm in gravity. Each joint mimics the one before. It starts folded and without error.
Model chain_of_couplings(int couplings);

/// chain8 with q_A = gear_ratio q_B and the last four links mass_ratio times as heavy. It starts without error and at
/// rest. Damping, 0.02 for equal masses, grows with the mass that a joint carries, so that the map tests the couplings
/// and the arithmetic, and not the integrator.
Model geared_arm(double gear_ratio, double mass_ratio);

/// chain8 with this damping of all joints, N m s/rad: tests how well the integrator conserves energy.
Model damped_arm(double damping);

/// chain8 with a servo on its first joint, kd = kp / 1000, 0.3 rad from the target.
Model driven_arm(double kp);

/// chain8 whose couplings start `error` rad off.
Model displaced_arm(double error);

/// A slider and four followers of 1 kg each, without gravity and damping. The couplings have this natural frequency
/// (Hz) and damping ratio. The leader starts 0.1 m off, so that all couplings start with the same error, at rest.
Model soft_star(double frequency, double damping_ratio);

}  // namespace lockstep::stability
