// Actuators as drives and efforts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "start.h"
#include "transmissions.h"

namespace lockstep::importer::mjcf {

/// Gives joints the drives, efforts and effort limits of the actuators. One on a tendon drives the tendon's
/// transmission. The report says how the file's controls become targets. What cannot be had is a warning.
void drive_joints(const Scene& scene, const Ties& ties, const std::vector<std::optional<Transmission>>& transmissions,
                  const Start& start, Draft& draft);

}  // namespace lockstep::importer::mjcf
