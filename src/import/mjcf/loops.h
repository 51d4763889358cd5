// Closed loops. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "scene.h"
#include "start.h"
#include "trees.h"

namespace lockstep::importer::mjcf {

/// Adds a loop for each <connect> and <weld>. What they hold together is what meets in the drawn pose, unless they give
/// both frames. The world and mocap bodies come first in a loop: Parameter::loop_frame moves them. Joints must be those
/// that couple() leaves.
void close_loops(const Scene& scene, const Start& start, const std::vector<Place>& places, Draft& draft);

}  // namespace lockstep::importer::mjcf
