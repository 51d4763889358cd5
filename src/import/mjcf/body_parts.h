// Joints, geoms and sites of a body, one by one. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bodies.h"

namespace lockstep::importer::mjcf {

// `frame` is that of the element around, in the body. Names are left to the caller, but for the geom's.
JointPart read_joint_part(Element element, const Eigen::Isometry3d& frame, const Settings& settings);
GeomPart read_geom(Element element, const Eigen::Isometry3d& frame, const std::string& suffix,
                   const Settings& settings);
SitePart read_site(const Element& element, const Eigen::Isometry3d& frame, const Settings& settings);

}  // namespace lockstep::importer::mjcf
