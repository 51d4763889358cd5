// URDF text to Model: import_urdf is the main path. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <unordered_set>

#include "lockstep/error.h"
#include "lockstep/import.h"
#include "repair.h"
#include "robot.h"

namespace lockstep {
namespace urdf {
namespace {

// No robot needs more text. The limit keeps a path such as /dev/zero from filling the memory.
constexpr std::size_t largest_file = std::size_t{256} << 20;

const char* const convert_remedy = "convert it to URDF, or fill a Model in code";

std::string text_of(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) throw ImportError(path, "is a folder", "name a URDF file in it");
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    throw ImportError(path, "cannot be opened: " + std::generic_category().message(errno),
                      "check the path and its permissions");
  std::string text;
  std::vector<char> piece(std::size_t{1} << 16);
  while (stream.read(piece.data(), static_cast<std::streamsize>(piece.size())) || stream.gcount() > 0) {
    text.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > largest_file)
      throw ImportError(path, fmt::format("is larger than {} MB", largest_file >> 20), "give a robot description");
  }
  if (stream.bad()) throw ImportError(path, "cannot be read to its end", "check the file and the disk");
  return text;
}

// The document's <robot>. Throws if there is anything beside it.
Element parsed(const std::string& text, File& file, tinyxml2::XMLDocument& document) {
  if (const std::size_t zero = text.find('\0'); zero != std::string::npos)
    throw ImportError(fmt::format("{}:{}", file.name, std::count(text.begin(), text.begin() + zero, '\n') + 1),
                      "is not UTF-8 text: it holds a zero byte", "save it as UTF-8");
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    const std::string place = fmt::format("{}:{}", file.name, document.ErrorLineNum());
    if (document.ErrorID() == tinyxml2::XML_ERROR_EMPTY_DOCUMENT)
      throw ImportError(file.name, "is empty", "give a URDF file, <robot name=\"...\"> ... </robot>");
    if (document.ErrorID() == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED)
      throw ImportError(place, fmt::format("nests elements deeper than {}", TINYXML2_MAX_ELEMENT_DEPTH),
                        "give a robot description; none needs that");
    throw ImportError(place, fmt::format("is not well-formed XML ({})", document.ErrorName()),
                      "check the tags and quotes there");
  }
  const tinyxml2::XMLElement* root = document.RootElement();
  for (auto* node = document.FirstChild(); node; node = node->NextSibling()) {
    const std::string place = fmt::format("{}:{}", file.name, node->GetLineNum());
    if (node->ToText() || (node->ToElement() && node != root))
      throw ImportError(place, "has text or elements outside of the root element", "keep one <robot> ... </robot>");
    if (node->ToUnknown() && std::string_view(node->Value()).find("ENTITY") != std::string_view::npos)
      throw ImportError(place, "declares entities, which are not expanded", "replace them by their text");
  }
  if (!root) throw ImportError(file.name, "has no XML element", "give a URDF file, <robot name=\"...\"> ... </robot>");
  Element element(*root, file, fmt::format("<{}>", shortened(root->Name())));
  const std::string_view tag = root->Name();
  if (tag == "sdf") element.fail("is SDF, not URDF", convert_remedy);
  if (tag == "mujoco") element.fail("is MJCF (MuJoCo), not URDF", convert_remedy);
  if (tag != "robot") element.fail("is no URDF: the root element is not <robot>", convert_remedy);
  return element;
}

// The rules that finding the root depends on. Model::validate() checks all others.
void check_names(const Robot& robot) {
  std::unordered_set<std::string> links;
  for (const Link& link : robot.model.links)
    if (!links.insert(link.name).second)
      throw ModelError("link '" + link.name + "'", "appears twice", "give each its own name");
  const auto check = [&](const Joint& joint) {
    for (const std::string& end : {joint.parent, joint.child})
      if (!links.count(end))
        throw ImportError(robot.places.at("joint '" + joint.name + "'"),
                          "refers to link '" + end + "', which does not exist", "add the link or correct the name");
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
  } else {
    model.roots = {{world.name}};
  }
  for (const auto& [joint, place] : robot.floating) {
    if (joint.parent != world.name)
      throw ImportError(place, "floats below link '" + joint.parent + "', which is not the root of the file",
                        "a link floats in the world, not on another link: let the root link '" + world.name +
                            "' be its parent, or use single joints");
    model.roots.push_back({joint.child, true, joint.origin});
    report.remark("floating roots instead of floating joints",
                  joint.name + (stands_for_world ? ", without its parent " + world.name : ""));
  }
  const auto first = model.links.begin() + model.link_index(model.roots.front().link);
  std::rotate(model.links.begin(), first, first + 1);
}

// The model as a step takes it: without the bounds that are ignored.
Model judged(Model model, const Ignored& ignore) {
  std::unordered_set<std::string> followers;
  for (const Coupling& coupling : model.couplings) followers.insert(coupling.joint);
  for (Joint& joint : model.joints) {
    const bool follows = followers.count(joint.name) > 0;
    if (holds(ignore.position_limits, joint.name, follows)) joint.lower = -infinity, joint.upper = infinity;
    if (holds(ignore.velocity_limits, joint.name, follows)) joint.velocity_limit = infinity;
    if (holds(ignore.effort_limits, joint.name, follows)) joint.effort_limit = infinity;
    if (holds(ignore.friction, joint.name, follows)) joint.friction = 0.0;
  }
  return model;
}

void report_joints(const Model& model, Report& report) {
  for (const Joint& joint : model.joints) {
    if (!joint.moves()) {
      report.remark("fixed joints, merged when compiling", joint.name);
      continue;
    }
    if (joint.position < joint.lower || joint.position > joint.upper)
      report.warn(
          "joints that start outside of their limits",
          fmt::format("{} at {:.4g}, not {:.4g} to {:.4g}", joint.name, joint.position, joint.lower, joint.upper));
    if (joint.lower == joint.upper) report.warn("joints that cannot move, lower = upper", joint.name);
    if (joint.lower > -infinity || joint.upper < infinity) report.kept("position limits");
    if (joint.velocity_limit < infinity) report.kept("velocity limits");
    if (joint.effort_limit < infinity) report.kept("effort limits");
    if (joint.friction > 0.0) report.kept("dry friction");
  }
}

// A misspelt name would ignore nothing.
void check_names(const Ignored& ignore, const Model& model) {
  for (const JointSet* set :
       {&ignore.position_limits, &ignore.velocity_limits, &ignore.effort_limits, &ignore.friction})
    for (const std::string& name : set->names) {
      const auto is_meant = [&](const Joint& joint) { return joint.name == name && joint.moves(); };
      if (std::none_of(model.joints.begin(), model.joints.end(), is_meant))
        throw SettingsError("ImportOptions::ignore", "names '" + shortened(name) + "', which is no moving joint",
                            "check the spelling");
    }
}

std::string summary(const Model& model) {
  std::size_t moving = 0;
  for (const Joint& joint : model.joints) moving += joint.moves();
  return fmt::format("read {}, {}, {}", counted(model.links.size(), "link"), counted(moving, "moving joint"),
                     counted(model.couplings.size(), "coupling"));
}

// Makes a valid Model of what was read.
void complete(Robot& robot, const ImportOptions& options, Report& report) {
  check_names(robot);
  check_names(options.ignore, robot.model);
  std::vector<Link>& links = robot.model.links;
  const auto root = links.begin() + static_cast<std::ptrdiff_t>(root_of(robot));
  std::rotate(links.begin(), root, root + 1);  // to the front; the others keep their order
  float_roots(robot, report);
  couple_mimics(robot.mimics, robot.model, report);
  if (options.change) options.change(robot.model);
  repair_inertias(options, robot, report);
  robot.model.validate();
  const Model as_stepped = judged(robot.model, options.ignore);
  report_mimic_ranges(as_stepped, report);
  report_joints(as_stepped, report);
}

}  // namespace
}  // namespace urdf

Import import_urdf(const std::string& text, const std::string& source, const ImportOptions& options) {
  urdf::File file{source, {}};
  tinyxml2::XMLDocument document(/*processEntities=*/false);
  urdf::Robot robot = urdf::read_robot(urdf::parsed(text, file, document), options);
  try {
    urdf::complete(robot, options, file.report);
  } catch (const ModelError& error) {
    const auto place = robot.places.find(error.element());
    const std::string meshes = error.element().starts_with("link") ? file.report.line(urdf::unused_meshes) : "";
    throw ModelError(place != robot.places.end() ? place->second : source + ": " + error.element(),
                     error.rule() + (meshes.empty() ? "" : "; " + meshes), error.remedy());
  }
  Import result{std::move(robot.model), file.report.lines(), file.report.warnings()};
  result.report.insert(result.report.begin(), urdf::summary(result.model));
  return result;
}

Import import_urdf_file(const std::string& path, const ImportOptions& options) {
  return import_urdf(urdf::text_of(path), path, options);
}

}  // namespace lockstep
