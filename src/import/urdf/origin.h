// <origin xyz rpy>. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "element.h"

namespace lockstep::importer::urdf {

/// The pose that the element's own xyz and rpy give; the identity without them.
Eigen::Isometry3d read_pose(Element& element);

/// The pose of the element's <origin>; the identity if it has none.
Eigen::Isometry3d read_origin(Element& owner);

}  // namespace lockstep::importer::urdf
