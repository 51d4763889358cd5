// Positions and orientations. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "element.h"
#include "settings.h"

namespace lockstep::importer::mjcf {

/// From pos and one of quat, axisangle, xyaxes, zaxis, euler. Throws ImportError where there are two of these.
Eigen::Isometry3d read_pose(const Element& element, const Settings& settings);

inline Eigen::Isometry3d shift(const Eigen::Vector3d& by) { return Eigen::Isometry3d(Eigen::Translation3d(by)); }

/// By angles as a file has them, in the order of its eulerseq.
Eigen::Quaterniond turn_by_euler(const Eigen::Vector3d& angles, const Settings& settings);

/// The least turn that takes z to the direction, which is not 0.
Eigen::Quaterniond turn_to(const Eigen::Vector3d& direction);

}  // namespace lockstep::importer::mjcf
