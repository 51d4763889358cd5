// SPDX-License-Identifier: Apache-2.0
#include "unused_names.h"

#include <fmt/format.h>

#include <algorithm>

namespace lockstep::importer::urdf {
namespace {

using Xml = tinyxml2::XMLElement;

class UnusedNames {
 public:
  UnusedNames(const Robot& robot, Report& report) : report_(report) {
    for (const Joint& joint : robot.model.joints) joints_.push_back(joint.name);
    for (const FloatingJoint& floating : robot.floating) joints_.push_back(floating.joint.name);
    for (const Link& link : robot.model.links) either_.push_back(link.name);
    links_ = either_;
    either_.insert(either_.end(), joints_.begin(), joints_.end());
  }

  void of_joint(const Xml& element, const char* attribute) { judge(element, attribute, joints_); }
  void of_link(const Xml& element, const char* attribute) { judge(element, attribute, links_); }
  void of_either(const Xml& element, const char* attribute) { judge(element, attribute, either_); }

 private:
  void judge(const Xml& element, const char* attribute, const std::vector<std::string>& names) {
    const char* const name = element.Attribute(attribute);
    if (!name || std::find(names.begin(), names.end(), name) != names.end()) return;
    const std::string meant = nearest(name, names);
    report_.warn("names that nothing has, in elements that are not used",
                 fmt::format("'{}' in line {}{}", shortened(name), element.GetLineNum(), exists(meant)));
  }

  Report& report_;
  std::vector<std::string> links_, joints_, either_;
};

template <class Use>
void each(const Xml& element, const char* tag, const Use& use) {
  for (const Xml* child = element.FirstChildElement(tag); child; child = child->NextSiblingElement(tag)) use(*child);
}

}  // namespace

void judge_unused_names(const Xml& robot_element, const Robot& robot, Report& report) {
  UnusedNames names(robot, report);
  for (const char* tag : {"transmission", "ros2_control"})
    each(robot_element, tag,
         [&](const Xml& element) { each(element, "joint", [&](const Xml& joint) { names.of_joint(joint, "name"); }); });
  each(robot_element, "gazebo", [&](const Xml& gazebo) { names.of_either(gazebo, "reference"); });
  each(robot_element, "sensor",
       [&](const Xml& sensor) { each(sensor, "parent", [&](const Xml& parent) { names.of_link(parent, "link"); }); });
}

}  // namespace lockstep::importer::urdf
