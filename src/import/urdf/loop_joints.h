// Closed loops as other tools write them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "robot.h"

namespace lockstep::importer::urdf {

/// Reads each <loop_joint> of a <robot>. They are left out with a warning if the options ask for that.
void read_loop_joints(Element& element, const ImportOptions& options, Robot& robot);

}  // namespace lockstep::importer::urdf
