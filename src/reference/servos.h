// Servos at their limits of effort, (M63). SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "convex.h"
#include "step.h"

namespace lockstep::reference {

/// What a joint's servo and feed-forward effort are in a step.
enum class Servo {
  linear,  ///< (M13), which is all that joints without an effort limit know
  low,     ///< at the limit: a constant force
  high,
  apart,  ///< left out of A and v*, to act as a curve
};

/// Whether the joint has a servo that may come to its limit. Those of kinematic drives have none.
bool limited_servo(const Joint& joint);

/// A mechanism and its inputs as they act. A servo at its limit is a joint without servo whose effort is the limit;
/// the effort of a joint that has no servo is held within the limit.
struct Acting {
  Mechanism mechanism;
  Inputs inputs;
};
Acting acting(const Mechanism& mechanism, const Inputs& inputs, const std::vector<Servo>& servos);

/// The impulse of one servo over the step, by its joint's speed at the end: a box around a line.
Curve servo_curve(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage, int dof);

/// What the limited servos are for the velocities at the end of the step.
std::vector<Servo> servos_at(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage,
                             const Eigen::VectorXd& velocity);

}  // namespace lockstep::reference
