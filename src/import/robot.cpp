// <link> and <joint>, one function for each element. SPDX-License-Identifier: Apache-2.0
#include "robot.h"

#include <cmath>

namespace lockstep::urdf {
namespace {

Eigen::Isometry3d read_origin(Element& owner) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::optional<Element> origin = owner.child("origin");
  if (!origin) return pose;
  pose.translation() = origin->triple("xyz", Eigen::Vector3d::Zero());
  const Eigen::Vector3d rpy = origin->triple("rpy", Eigen::Vector3d::Zero());
  const Eigen::AngleAxisd roll(rpy[0], Eigen::Vector3d::UnitX()), pitch(rpy[1], Eigen::Vector3d::UnitY()),
      yaw(rpy[2], Eigen::Vector3d::UnitZ());
  pose.linear() = (yaw * pitch * roll).toRotationMatrix();  // about the parent's fixed axes, the roll first
  origin->tally_rest();
  return pose;
}

Inertia read_inertial(Element inertial) {
  const Eigen::Isometry3d pose = read_origin(inertial);
  Element mass = inertial.only_child("mass"), tensor = inertial.only_child("inertia");
  Inertia inertia;
  inertia.mass = mass.number("value");
  inertia.center = pose.translation();
  const double xx = tensor.number("ixx"), xy = tensor.number("ixy"), xz = tensor.number("ixz");
  const double yy = tensor.number("iyy"), yz = tensor.number("iyz"), zz = tensor.number("izz");
  Eigen::Matrix3d about_center;
  about_center << xx, xy, xz,  //
      xy, yy, yz,              //
      xz, yz, zz;
  inertia.about_center = pose.linear() * about_center * pose.linear().transpose();
  for (Element* element : {&mass, &tensor, &inertial}) element->tally_rest();
  return inertia;
}

void read_link(Element element, Robot& robot) {
  Link link;
  link.name = element.name("name");
  element.rename("link '" + link.name + "'");
  if (std::optional<Element> inertial = element.child("inertial")) link.inertia = read_inertial(*inertial);
  element.tally_rest();
  robot.model.links.push_back(std::move(link));
}

void read_limit(Element& owner, Joint& joint) {
  std::optional<Element> limit = owner.child("limit");
  if (!limit) {
    if (joint.kind != JointKind::continuous) owner.report().remark("no <limit>, taken as unlimited", joint.name);
    return;
  }
  const bool has_range = joint.kind != JointKind::continuous;
  if (has_range) {
    if (!limit->has("lower") || !limit->has("upper"))
      owner.report().remark("<limit> without lower or upper, taken as 0", joint.name);
    joint.lower = limit->number("lower", 0.0);
    joint.upper = limit->number("upper", 0.0);
  }
  if (!limit->has("effort") || !limit->has("velocity"))
    owner.report().remark("<limit> without effort or velocity, taken as unlimited", joint.name);
  joint.effort_limit = limit->number("effort", infinity);
  joint.velocity_limit = limit->number("velocity", infinity);
  // URDF requires both numbers, so files have 0 where the number was not known. Taken literally, an effort of 0 would
  // leave the joint without a drive, and a velocity of 0 would lock it.
  if (joint.effort_limit == 0.0 || joint.velocity_limit == 0.0)
    owner.report().remark("<limit> with effort or velocity 0, taken as unlimited", joint.name);
  if (joint.effort_limit == 0.0) joint.effort_limit = infinity;
  if (joint.velocity_limit == 0.0) joint.velocity_limit = infinity;
  limit->tally_rest(has_range ? "" : " of continuous joints");
}

// The parts that only moving joints have.
void read_motion(Element& element, Joint& joint, Robot& robot) {
  if (std::optional<Element> axis = element.child("axis")) {
    joint.axis = axis->triple("xyz");
    axis->tally_rest();
  }
  const double length = joint.axis.norm();
  if (length > 0.0 && std::abs(length - 1.0) > 1e-3)
    element.report().remark("axes not of length 1, taken as directions", joint.name);
  if (std::optional<Element> dynamics = element.child("dynamics")) {
    joint.damping = dynamics->number("damping", 0.0);
    joint.friction = dynamics->number("friction", 0.0);
    dynamics->tally_rest();
  }
  read_limit(element, joint);
  if (std::optional<Element> mimic = element.child("mimic")) {
    robot.mimics.push_back({robot.model.joints.size(), mimic->name("joint"), mimic->number("multiplier", 1.0),
                            mimic->number("offset", 0.0)});
    mimic->tally_rest();
  }
}

void read_joint(Element element, Robot& robot) {
  static const std::unordered_map<std::string, JointKind> kinds = {{"fixed", JointKind::fixed},
                                                                   {"revolute", JointKind::revolute},
                                                                   {"continuous", JointKind::continuous},
                                                                   {"prismatic", JointKind::prismatic}};
  Joint joint;
  joint.name = element.name("name");
  element.rename("joint '" + joint.name + "'");
  const std::string type = element.name("type");
  Element parent = element.only_child("parent"), child = element.only_child("child");
  joint.parent = parent.name("link");
  joint.child = child.name("link");
  joint.origin = read_origin(element);
  for (Element* end : {&parent, &child}) end->tally_rest();
  const auto kind = kinds.find(type);
  if (kind != kinds.end()) joint.kind = kind->second;

  if (joint.moves()) read_motion(element, joint, robot);
  element.tally_rest(type == "fixed" ? " of fixed joints" : "");
  robot.joint_places.emplace(joint.name, element.place());
  if (type == "floating" && !robot.floating) {
    robot.floating = {std::move(joint), element.place()};
    return;
  }
  if (type == "planar" || type == "floating")
    element.fail("is of type " + type + ", which lockstep does not have",
                 "build it from single joints: prismatic, then revolute, with light links between them");
  if (kind == kinds.end())
    element.fail("is of type '" + shortened(type) + "', which URDF does not have",
                 "write revolute, continuous, prismatic or fixed");
  robot.model.joints.push_back(std::move(joint));
}

}  // namespace

Robot read_robot(Element element) {
  Robot robot;
  if (element.has("name"))
    robot.model.name = element.name("name");
  else
    element.report().remark("a robot without a name, called", robot.model.name);
  element.rename("robot '" + robot.model.name + "'");
  element.each_child("link", [&](Element link) { read_link(std::move(link), robot); });
  element.each_child("joint", [&](Element joint) { read_joint(std::move(joint), robot); });
  element.tally_rest();
  if (robot.model.links.empty()) element.fail("has no links", "add at least <link name=\"base\"/>");
  return robot;
}

}  // namespace lockstep::urdf
