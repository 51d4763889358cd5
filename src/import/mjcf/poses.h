// Keyframes as named poses. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "drive.h"

namespace lockstep::importer::mjcf {

/// Adds a pose for each key, of all joints and roots that are read. Servos hold the pose, unless the key has controls.
void add_poses(const Scene& scene, const Start& start, const std::vector<Key>& keys,
               const std::vector<Control>& controls, Draft& draft);

}  // namespace lockstep::importer::mjcf
