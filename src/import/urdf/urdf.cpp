// URDF text to Model: import_urdf is the main path. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <unordered_map>
#include <unordered_set>

#include "import/finish.h"
#include "import/options.h"
#include "import/paths.h"
#include "import/text.h"
#include "import/xml.h"
#include "lockstep/error.h"
#include "lockstep/import.h"
#include "robot.h"
#include "unused_names.h"
#include "urdf.h"

namespace lockstep {
namespace importer::urdf {
namespace {

Element robot_of(const tinyxml2::XMLElement& root, File& file) {
  Element element(root, file, fmt::format("<{}>", shortened(root.Name())));
  const std::string_view tag = root.Name();
  if (tag == "mujoco")
    element.fail("is MJCF (MuJoCo), not URDF", "read it by import_mjcf_file(), or by import_file(), which reads both");
  if (tag != "robot")
    element.fail("is no URDF: the root element is not <robot>", "convert it to URDF, or fill a Model in code");
  return element;
}

// The rules that finding the root depends on. Model::validate() checks all others.
void check_names(const Robot& robot) {
  std::unordered_set<std::string> links, joints;
  std::vector<std::string> names;
  for (const Link& link : robot.model.links) {
    names.push_back(link.name);
    if (!links.insert(link.name).second)
      throw ModelError("link '" + link.name + "'", "appears twice", "give each its own name");
  }
  const auto check = [&](const Joint& joint) {
    if (!joints.insert(joint.name).second)
      throw ModelError("joint '" + joint.name + "'", "appears twice", "give each its own name");
    for (const std::string& end : {joint.parent, joint.child})
      if (!links.count(end))
        throw ImportError(robot.places.at("joint '" + joint.name + "'"),
                          "refers to link '" + end + "', which does not exist",
                          "add the link, or correct the name" + exists(nearest(end, names)));
  };
  for (const Joint& joint : robot.model.joints) check(joint);
  for (const FloatingJoint& floating : robot.floating) check(floating.joint);
}

std::size_t root_of(const Robot& robot) {
  std::unordered_set<std::string> children;
  for (const Joint& joint : robot.model.joints) children.insert(joint.child);
  for (const FloatingJoint& floating : robot.floating) children.insert(floating.joint.child);
  std::vector<std::string> names;
  std::size_t root = 0;
  for (std::size_t i = 0; i < robot.model.links.size(); ++i) {
    if (children.count(robot.model.links[i].name)) continue;
    names.push_back(robot.model.links[i].name);
    root = i;
  }
  const std::string element = "robot '" + robot.model.name + "'";
  if (names.empty())
    throw ModelError(element, "has no root: each of its links is the child of a joint", "cut the loop of joints");
  if (names.size() > 1)
    throw ModelError(element, "has several roots, links that no joint carries: " + listed(names),
                     "connect them with joints, or remove all but one");
  return root;
}

// A link that floats below the root link, which stands still in the world, is the root of a tree of its own. A root
// link without mass that carries nothing else stands for the world and is left out.
void float_roots(Robot& robot, Report& report) {
  Model& model = robot.model;
  const Link world = model.links[0];
  bool stands_for_world =
      !robot.floating.empty() && world.inertia.mass == 0.0 && world.inertia.about_center.isZero(0.0);
  for (const Joint& joint : model.joints) stands_for_world = stands_for_world && joint.parent != world.name;
  if (stands_for_world) {
    model.links.erase(model.links.begin());
    for (Collider& collider : model.colliders)
      if (collider.link == world.name) collider.link.clear();
    for (Loop& loop : model.loops)
      for (std::string* end : {&loop.first, &loop.second})
        if (*end == world.name) end->clear();
  } else {
    model.roots = {{world.name}};
  }
  std::map<std::string, const Joint*> carried;
  for (const Joint& joint : model.joints) carried.emplace(joint.child, &joint);
  for (const FloatingJoint& floating : robot.floating) carried.emplace(floating.joint.child, &floating.joint);
  for (const auto& [joint, place] : robot.floating) {
    // Where it stands when all joints are at 0: it moves with nothing. A circle of joints is refused later.
    Eigen::Isometry3d pose(joint.origin);
    auto at = carried.find(joint.parent);
    for (std::size_t steps = 0; at != carried.end() && steps < carried.size(); ++steps) {
      pose = Eigen::Isometry3d(at->second->origin) * pose;
      at = carried.find(at->second->parent);
    }
    model.roots.push_back({joint.child, true, Pose(pose)});
    if (joint.parent != world.name)
      report.warn("floating joints below links, as roots that float in the world: their poses are those in the world",
                  joint.name);
    else
      report.remark("floating roots instead of floating joints",
                    joint.name + (stands_for_world ? ", without its parent " + world.name : ""));
  }
  const auto first = model.links.begin() + model.link_index(model.roots.front().link);
  std::rotate(model.links.begin(), first, first + 1);
}

// A mimic follows the one angle or length of its leader.
void check_leaders(const Robot& robot) {
  std::unordered_map<std::string, const char*> kinds;  // of joints with several
  for (const FloatingJoint& floating : robot.floating) kinds.emplace(floating.joint.name, "floating");
  for (const Joint& joint : robot.model.joints)
    if (joint.kind == JointKind::ball) kinds.emplace(joint.name.substr(0, joint.name.rfind('.')), "a ball joint");
  for (const Mimic& mimic : robot.mimics)
    if (const auto found = kinds.find(mimic.leader); found != kinds.end())
      throw ModelError("joint '" + robot.model.joints[mimic.follower].name + "'",
                       "mimics joint '" + mimic.leader + "', which is " + found->second,
                       "name a joint with one axis: revolute, continuous or prismatic");
}

// Links and joints as trees with couplings.
void assemble(Robot& robot, Report& report) {
  check_names(robot);
  std::vector<Link>& links = robot.model.links;
  const auto root = links.begin() + static_cast<std::ptrdiff_t>(root_of(robot));
  std::rotate(links.begin(), root, root + 1);  // to the front; the others keep their order
  float_roots(robot, report);
  check_leaders(robot);
  couple_mimics(robot.mimics, robot.model, report);
}

}  // namespace

Import read(const std::string& text, const std::string& source, const std::string& folder,
            const ImportOptions& options) {
  refuse_others(options, Format::urdf);
  File file{source, {}};
  if (!folder.empty()) file.report.note_file(source);
  tinyxml2::XMLDocument document(/*processEntities=*/false);
  const tinyxml2::XMLElement& root =
      parsed(text, source, "a URDF file, <robot name=\"...\"> ... </robot>", document, file.report);
  MeshFiles meshes(options, folder, file.report);
  Robot robot = read_robot(robot_of(root, file), options, meshes);
  judge_unused_names(root, robot, file.report);
  return finished(robot, options, file.report, source, [&] { assemble(robot, file.report); });
}

}  // namespace importer::urdf

Import import_urdf(const std::string& text, const std::string& source, const ImportOptions& options) {
  return importer::urdf::read(text, source, "", options);
}

Import import_urdf_file(const std::string& path, const ImportOptions& options) {
  return importer::urdf::read(importer::text_of(path), path, importer::folder_of(path), options);
}

}  // namespace lockstep
