// Named poses of a Model: their rules, and the model that starts in one. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "lockstep/model.h"

namespace lockstep {

/// Throws ModelError for the first rule that the pose breaks.
void proper_pose(const Model& model, const NamedPose& pose);

/// The model, starting in the pose.
Model started_in(const NamedPose& pose, Model model);

}  // namespace lockstep
