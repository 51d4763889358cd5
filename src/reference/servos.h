// Servos at their limits of effort, (M63). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "convex.h"
#include "step.h"

namespace lockstep::reference {

/// How a joint's servo and feed-forward effort act in a step.
enum class Servo {
  linear,  ///< as in (M13); always, if the joint has no effort limit
  low,     ///< at the lower limit: a constant force
  high,    ///< at the upper limit
  apart,   ///< not in A and v*; the servo acts as a curve
};

/// True if the joint has a servo with an effort limit.
bool limited_servo(const Joint& joint);

/// The mechanism and its inputs, changed to act as `servos` says. A joint whose servo is at its limit has no servo, and
/// the limit is its effort. The effort of a joint without a servo is clamped to the limit.
struct Acting {
  Mechanism mechanism;
  Inputs inputs;
};
Acting acting(const Mechanism& mechanism, const Inputs& inputs, const std::vector<Servo>& servos);

/// The impulse of one servo over the step as a function of its joint's speed at the end: a line, cut at the limits.
Curve servo_curve(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage, int dof);

/// How the limited servos act for the given velocities at the end of the step.
std::vector<Servo> servos_at(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage,
                             const Eigen::VectorXd& velocity);

}  // namespace lockstep::reference
