// Actuators as drives and efforts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "start.h"
#include "transmissions.h"

namespace lockstep::importer::mjcf {

/// What an actuator's control u does: scale u + shift along a joint.
struct Control {
  enum class Aim {
    position,  ///< kp times the position target
    velocity,  ///< kd times the velocity target
    effort,
  };
  int joint;  ///< of the model
  Aim aim;
  double scale, shift;
  std::size_t actuator;  ///< of the scene
};

/// Gives joints the drives, efforts and effort limits of the actuators. One on a tendon drives the tendon's
/// transmission. The report says how the file's controls become targets. What cannot be had is a warning. Returns what
/// the controls do.
std::vector<Control> drive_joints(const Scene& scene, const Ties& ties,
                                  const std::vector<std::optional<Transmission>>& transmissions, const Start& start,
                                  Draft& draft);

/// The control of an actuator of the scene at a start that has controls, within its range.
double control_at(const Scene& scene, const Start& start, std::size_t actuator);

}  // namespace lockstep::importer::mjcf
