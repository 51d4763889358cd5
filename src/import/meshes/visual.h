// What meshes look like. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "import/report.h"
#include "solid.h"

namespace lockstep::importer {

/// The mesh as the link shows it, of at most 20 000 triangles. `pose` is that of the mesh in the link's frame. Tells
/// the report what is simplified.
VisualMesh visual_of(const Solid& solid, const std::string& link, const Eigen::Isometry3d& pose, Report& report);

}  // namespace lockstep::importer
