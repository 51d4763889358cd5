// <origin xyz rpy>. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "element.h"

namespace lockstep::importer::urdf {

/// The pose of the element's <origin>; the identity if it has none.
Eigen::Isometry3d read_origin(Element& owner);

}  // namespace lockstep::importer::urdf
