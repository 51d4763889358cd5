// How MuJoCo's bodies answer a push. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "bodies.h"

namespace lockstep::exporter::mjcf {

/// By link: A of (M164) for its body, in the pose that the file draws, 1/kg. 0 for links that have no body or stand
/// still.
std::vector<double> body_responses(const Model& model, const Layout& layout);

}  // namespace lockstep::exporter::mjcf
