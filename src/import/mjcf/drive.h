// Actuators as drives and efforts. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "import/draft.h"
#include "scene.h"
#include "start.h"
#include "ties.h"

namespace lockstep::importer::mjcf {

/// Gives joints the drives, efforts and effort limits of the actuators. One on a tendon drives the joint that the
/// tendon's joints are tied to. The report says how the file's controls become targets. What cannot be had is a
/// warning.
void drive_joints(const Scene& scene, const Ties& ties, const Start& start, Draft& draft);

}  // namespace lockstep::importer::mjcf
