// Names in elements that a Model has no use for. SPDX-License-Identifier: Apache-2.0
#pragma once

#include "robot.h"

namespace lockstep::importer::urdf {

/// Warns of joints and links that <transmission>, <ros2_control>, <gazebo> and <sensor> name and nothing has: whoever
/// misspells a name has another robot in mind.
void judge_unused_names(const tinyxml2::XMLElement& robot_element, const Robot& robot, Report& report);

}  // namespace lockstep::importer::urdf
