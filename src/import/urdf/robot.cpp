// <link> and <joint>, one function for each element. SPDX-License-Identifier: Apache-2.0
#include "robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "collisions.h"
#include "foreign.h"
#include "import/finish.h"
#include "loop_joints.h"
#include "origin.h"
#include "visuals.h"

namespace lockstep::importer::urdf {

Eigen::Isometry3d read_pose(Element& element) {
  if (element.has("quat_xyzw"))
    element.fail("has quat_xyzw, which lockstep does not read", "write the same rotation as rpy");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = element.triple("xyz", Eigen::Vector3d::Zero());
  const Eigen::Vector3d rpy = element.triple("rpy", Eigen::Vector3d::Zero());
  const Eigen::AngleAxisd roll(rpy[0], Eigen::Vector3d::UnitX()), pitch(rpy[1], Eigen::Vector3d::UnitY()),
      yaw(rpy[2], Eigen::Vector3d::UnitZ());
  pose.linear() = (yaw * pitch * roll).toRotationMatrix();  // about the parent's fixed axes, the roll first
  return pose;
}

Eigen::Isometry3d read_origin(Element& owner) {
  std::optional<Element> origin = owner.child("origin");
  if (!origin) return Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d pose = read_pose(*origin);
  origin->tally_rest();
  return pose;
}

namespace {

Inertia read_inertial(Element inertial, LinkExtras& extras) {
  const Eigen::Isometry3d pose = read_origin(inertial);
  Inertia inertia;
  inertia.center = pose.translation();
  std::optional<Element> mass = inertial.child("mass"), tensor = inertial.child("inertia");
  if (mass) {
    inertia.mass = mass->number("value");
    mass->tally_rest();
  }
  if (tensor) {
    const double xx = tensor->number("ixx"), xy = tensor->number("ixy"), xz = tensor->number("ixz");
    const double yy = tensor->number("iyy"), yz = tensor->number("iyz"), zz = tensor->number("izz");
    Eigen::Matrix3d about_center;
    about_center << xx, xy, xz,  //
        xy, yy, yz,              //
        xz, yz, zz;
    inertia.about_center = pose.linear() * about_center * pose.linear().transpose();
    tensor->tally_rest();
  }
  extras.lacks_mass = tensor && !mass;
  extras.lacks_tensor = inertia.mass != 0.0 && !tensor;
  inertial.tally_rest();
  return inertia;
}

void take_colliders(const Shapes& shapes, Report& report, Model& model) {
  for (const Collider& collider : shapes.colliders) {
    report.remark("colliders of the group 'robot'", collider.name);
    model.colliders.push_back(collider);
  }
}

void read_link(Element element, const ImportOptions& options, MeshFiles& meshes, Robot& robot) {
  Link link;
  link.name = element.name("name");
  element.rename("link '" + link.name + "'");
  robot.places[element.title()] = element.place();
  LinkExtras extras;
  if (std::optional<Element> inertial = element.child("inertial")) link.inertia = read_inertial(*inertial, extras);
  const bool is_complete = link.inertia.mass != 0.0 && !extras.lacks_tensor;
  const bool weighs = options.density > 0.0 && !is_complete;
  if (weighs || options.colliders) {
    extras.shapes = read_shapes(element, link.name, options, weighs, meshes);
    if (options.colliders) take_colliders(extras.shapes, element.report(), robot.model);
    if (is_complete) extras.shapes = {};
  }
  if (options.visual_meshes)
    for (VisualMesh& visual : read_visuals(element, link.name, options, meshes))
      robot.visual_meshes.push_back(std::move(visual));
  element.tally_rest();
  if (extras.lacks_mass || extras.lacks_tensor || extras.shapes.collisions > 0)
    robot.extras[link.name] = std::move(extras);
  robot.model.links.push_back(std::move(link));
}

constexpr const char* world = "world";

// Which bounds of one joint are not judged.
struct NotJudged {
  bool position, velocity, effort;
};

void left_out(const Element& element, const Joint& joint, const char* kind) {
  element.report().remark("impossible bounds, left out because they are ignored",
                          fmt::format("{} ({})", joint.name, kind));
}

// Effort or velocity. URDF requires both numbers, so files have 0 or -1 where the number was not known. Taken
// literally, an effort of 0 would leave the joint without a drive, and a velocity of 0 would lock it.
double read_least_bound(Element& limit, const char* attribute, bool is_judged, const Joint& joint) {
  if (is_judged && !limit.has(attribute))
    limit.report().remark("<limit> without effort or velocity, taken as unlimited",
                          fmt::format("{} ({})", joint.name, attribute));
  const std::optional<double> bound =
      is_judged ? limit.number(attribute, infinity) : limit.number_if_any(attribute, infinity);
  if (!bound) return left_out(limit, joint, attribute), infinity;
  if (*bound > 0.0) return *bound;
  limit.report().remark(*bound < 0.0 ? "<limit> with effort or velocity below 0, taken as unlimited"
                                     : "<limit> with effort or velocity 0, taken as unlimited",
                        fmt::format("{} ({})", joint.name, attribute));
  return infinity;
}

void read_range(Element& limit, bool is_judged, Joint& joint) {
  if (!limit.has("lower") || !limit.has("upper"))
    limit.report().remark("<limit> without lower or upper, taken as 0", joint.name);
  if (is_judged) {
    joint.lower = limit.number("lower", 0.0);
    joint.upper = limit.number("upper", 0.0);
    return;
  }
  const std::optional<double> lower = limit.number_if_any("lower", 0.0), upper = limit.number_if_any("upper", 0.0);
  if (!lower || !upper || *lower > *upper) return left_out(limit, joint, "position");
  joint.lower = *lower;
  joint.upper = *upper;
}

void read_limit(Element& owner, const NotJudged& ignored, Joint& joint) {
  const bool has_range = joint.kind != JointKind::continuous && joint.kind != JointKind::ball;
  std::optional<Element> limit = owner.child("limit");
  if (!limit) {
    if (has_range) owner.report().remark("no <limit>, taken as unlimited", joint.name);
    return;
  }
  if (has_range) read_range(*limit, !ignored.position, joint);
  joint.effort_limit = read_least_bound(*limit, "effort", !ignored.effort, joint);
  joint.velocity_limit = read_least_bound(*limit, "velocity", !ignored.velocity, joint);
  limit->tally_rest(has_range ? "" : " of continuous joints");
}

void read_dynamics(Element& owner, bool has_friction, Joint& joint) {
  std::optional<Element> dynamics = owner.child("dynamics");
  if (!dynamics) return;
  joint.damping = dynamics->number("damping", 0.0);
  const std::optional<double> friction =
      has_friction ? dynamics->number("friction", 0.0) : dynamics->number_if_any("friction", 0.0);
  if (has_friction || (friction && *friction >= 0.0))
    joint.friction = *friction;
  else
    left_out(*dynamics, joint, "friction");
  dynamics->tally_rest();
}

// Of the joint that is the next one of the robot.
Mimic read_mimic(Element mimic, const Joint& joint, Robot& robot) {
  Mimic read{robot.model.joints.size(), mimic.name("joint"), mimic.number("multiplier", 1.0),
             mimic.number("offset", 0.0)};
  mimic.refuse_rest("write joint, multiplier and offset as attributes of <mimic>, and nothing else");
  robot.places["coupling '" + joint.name + "'"] = fmt::format("{}: coupling '{}'", mimic.line(), joint.name);
  return read;
}

// The parts that only moving joints have.
std::optional<Mimic> read_motion(Element& element, const Ignored& ignore, Joint& joint, Robot& robot) {
  if (std::optional<Element> axis = element.child("axis")) {
    joint.axis = axis->triple("xyz");
    axis->tally_rest();
  }
  const double length = joint.axis.norm();
  if (length > 0.0 && std::abs(length - 1.0) > 1e-3)
    element.report().remark("axes not of length 1, taken as directions", joint.name);
  std::optional<Element> mimic = element.one_child("mimic");
  const auto ignored = [&](const JointSet& set) { return holds(set, joint.name, mimic.has_value()); };
  read_dynamics(element, !ignored(ignore.friction), joint);
  read_limit(element, {ignored(ignore.position_limits), ignored(ignore.velocity_limits), ignored(ignore.effort_limits)},
             joint);
  if (!mimic) return std::nullopt;
  return read_mimic(std::move(*mimic), joint, robot);
}

// With the numbers of the file along all axes.
void add_ball(const Joint& read, const std::string& place, Robot& robot) {
  const int first = robot.model.add_ball(read.name, read.parent, read.child, read.origin);
  for (int k = 0; k < 3; ++k) {
    Joint& part = robot.model.joints[static_cast<std::size_t>(first + k)];
    part.damping = read.damping, part.friction = read.friction;
    part.velocity_limit = read.velocity_limit, part.effort_limit = read.effort_limit;
    robot.places["joint '" + part.name + "'"] = place;
  }
}

// `carrier` holds the links that joints carry so far, with the joint.
void read_joint(Element element, const ImportOptions& options, std::unordered_map<std::string, std::string>& carrier,
                Robot& robot) {
  static const std::unordered_map<std::string, JointKind> kinds = {
      {"fixed", JointKind::fixed},         {"revolute", JointKind::revolute}, {"continuous", JointKind::continuous},
      {"prismatic", JointKind::prismatic}, {"spherical", JointKind::ball},    {"ball", JointKind::ball}};
  Joint joint;
  joint.name = element.name("name");
  element.rename("joint '" + joint.name + "'");
  const std::string type = element.name("type");
  Element parent = element.only_child("parent"), child = element.only_child("child");
  joint.parent = parent.name("link");
  joint.child = child.name("link");
  joint.origin = read_origin(element);
  for (Element* end : {&parent, &child}) end->tally_rest();
  const auto [carried, is_first] = carrier.emplace(joint.child, joint.name);
  if (!is_first) {
    if (!options.leave_out_foreign)
      return element.refuse_later(fmt::format("carries link '{}', as joint '{}' does already: that closes a loop",
                                              joint.child, carried->second),
                                  "remove one of them, lockstep models trees; or leave the later ones out: "
                                  "ImportOptions::leave_out_foreign");
    return element.report().warn("left out on request",
                                 element.title() + ", closes a loop at link '" + joint.child + "'");
  }
  const auto kind = kinds.find(type);
  if (kind != kinds.end()) joint.kind = kind->second;

  std::optional<Mimic> mimic;
  if (joint.moves()) mimic = read_motion(element, options.ignore, joint, robot);
  element.tally_rest(type == "fixed" ? " of fixed joints" : "");
  robot.places[element.title()] = element.place();
  if (type == "floating") {
    robot.floating.push_back({std::move(joint), element.place()});
    return;
  }
  if (type == "planar")
    element.fail("is of type " + type + ", which lockstep does not have",
                 "build it from single joints: prismatic, then revolute, with light links between them");
  if (kind == kinds.end())
    element.fail("is of type '" + shortened(type) + "', which URDF does not have",
                 "write revolute, continuous, prismatic or fixed");
  if (joint.kind == JointKind::ball) {
    if (mimic) element.fail("is a ball joint that follows another joint", "let joints with one axis follow");
    return add_ball(joint, element.place(), robot);
  }
  if (mimic) robot.mimics.push_back(std::move(*mimic));
  robot.model.joints.push_back(std::move(joint));
}

void name_robot(Element& element, Model& model) {
  if (!element.has("name"))
    element.report().remark("a robot without a name, called", model.name);
  else if (element.has_blank("name"))
    element.report().warn("a robot with an empty name, called", model.name);
  else
    model.name = element.name("name");
}

// Drake's files have joints on its world without a link for it.
void add_world(const Element& element, Robot& robot) {
  const auto is_world = [](const Link& link) { return link.name == world; };
  const auto is_on_world = [](const Joint& joint) { return joint.parent == world; };
  const auto floats_in_world = [&](const FloatingJoint& floating) { return is_on_world(floating.joint); };
  std::vector<Link>& links = robot.model.links;
  if (std::any_of(links.begin(), links.end(), is_world) ||
      (std::none_of(robot.model.joints.begin(), robot.model.joints.end(), is_on_world) &&
       std::none_of(robot.floating.begin(), robot.floating.end(), floats_in_world)))
    return;
  links.emplace_back().name = world;
  robot.places[fmt::format("link '{}'", world)] = element.place();
  element.report().warn("links that the file does not have, taken for the world, as Drake does", world);
}

}  // namespace

Robot read_robot(Element element, const ImportOptions& options, MeshFiles& meshes) {
  Report& report = element.report();
  Robot robot;
  element.refuse_xacro();
  name_robot(element, robot.model);
  element.rename("robot '" + robot.model.name + "'");
  robot.places[element.title()] = element.place();
  bool is_whole = true;
  element.each_child("link", [&](Element link) {
    is_whole &= report.attempt([&] { read_link(std::move(link), options, meshes, robot); });
  });
  std::unordered_map<std::string, std::string> carrier;
  element.each_child("joint", [&](Element joint) {
    is_whole &= report.attempt([&] { read_joint(std::move(joint), options, carrier, robot); });
  });
  read_loop_joints(element, options, robot);
  std::vector<std::string> followers;
  for (const Mimic& mimic : robot.mimics) followers.push_back(robot.model.joints[mimic.follower].name);
  judge_foreign(element, followers, options);
  is_whole &= report.attempt([&] {
    element.tally_rest();
    if (is_whole && robot.model.links.empty()) element.fail("has no links", "add at least <link name=\"base\"/>");
  });
  if (!is_whole) report.stop_if_refused();
  add_world(element, robot);
  return robot;
}

}  // namespace lockstep::importer::urdf
