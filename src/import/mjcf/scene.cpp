// All sections of a file. SPDX-License-Identifier: Apache-2.0
#include "scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "body_inertia.h"
#include "lockstep/error.h"

namespace lockstep::importer::mjcf {
namespace {

void choose_bodies(Scene& scene) {
  const std::vector<Body>& all = scene.bodies.all;
  scene.is_read.assign(all.size(), scene.options.body.empty());
  if (scene.options.body.empty()) return;
  const auto found = scene.body_of.find(scene.options.body);
  if (found == scene.body_of.end() || found->second == 0) {
    std::vector<std::string> names;
    for (std::size_t i = 1; i < all.size(); ++i) names.push_back(all[i].name);
    throw SettingsError("ImportOptions::body", "names '" + shortened(scene.options.body) + "', which is no body",
                        "correct the name" + exists(nearest(scene.options.body, names)));
  }
  int left_out = 0;
  for (std::size_t i = 1; i < all.size(); ++i) {
    scene.is_read[i] = static_cast<int>(i) == found->second || scene.is_read[static_cast<std::size_t>(all[i].parent)];
    left_out += !scene.is_read[i];
  }
  scene.report().remark("bodies left out on request", fmt::format("{} beside {}", left_out, scene.options.body));
}

// Files that were written for a main file in radian and are read without it.
void suspect_angles(const Scene& scene) {
  if (scene.settings.angle_is_given) return;
  double widest = 0.0;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const JointPart& joint = scene.joint(static_cast<int>(j));
    if (scene.bodies.all[static_cast<std::size_t>(scene.joints[j].body)].part > 0) continue;
    if (joint.type == JointType::hinge && joint.lower > -infinity)
      widest = std::max({widest, std::abs(joint.lower), std::abs(joint.upper)});
  }
  const double degrees = widest * 180.0 / 3.14159265358979323846;
  if (degrees > 0.0 && degrees < 6.4)
    scene.report().warn("no <compiler angle>, so hinge angles are degrees, and perhaps meant as radians",
                        fmt::format("the widest range ends at {:.2g} degrees", degrees));
}

// Flexes pull at the bodies that carry their corners; skins are drawn only.
void name_flexes(const Scene& scene) {
  for (const Element::Xml* xml : scene.document.section("deformable"))
    if (std::string_view(xml->Name()) == "flex")
      scene.report().warn("flexes, left out", Element(scene.document, *xml).place());
}

}  // namespace

void Form::add(int joint, double coefficient) {
  const auto same = std::find_if(terms.begin(), terms.end(), [&](const auto& term) { return term.first == joint; });
  if (same == terms.end())
    terms.emplace_back(joint, coefficient);
  else
    same->second += coefficient;
}

void Scene::fail_to_find(const Element& element, std::string_view kind, const std::string& name) const {
  const auto there = known.find(kind);
  std::vector<std::string> names(there->second.begin(), there->second.end());
  std::sort(names.begin(), names.end());
  mjcf::fail_to_find(element, kind, name, names);
}

const Tendon& Scene::tendon(const std::string& name, const Element& element) const {
  const auto found = tendon_of.find(name);
  if (found == tendon_of.end()) fail_to_find(element, "tendon", name);
  return tendons[static_cast<std::size_t>(found->second)];
}

int Scene::scalar_joint(const std::string& name, const Element& element) const {
  const auto found = joint_of.find(name);
  if (found == joint_of.end()) fail_to_find(element, "joint", name);
  const JointType type = joint(found->second).type;
  if (type != JointType::hinge && type != JointType::slide)
    element.fail(fmt::format("names joint '{}', which is no hinge or slide", shortened(name)), "name one of these");
  return is_joint_read(found->second) ? found->second : -1;
}

Scene read_scene(Document& document, const Settings& settings, const Classes& classes, const ImportOptions& options,
                 Meshes& meshes) {
  Scene scene{.document = document,
              .settings = settings,
              .classes = classes,
              .options = options,
              .meshes = meshes,
              .bodies = read_bodies(document, settings, classes)};
  scene.report().stop_if_refused();  // what refers to the parts of bodies would be refused, too
  for (std::size_t b = 0; b < scene.bodies.all.size(); ++b) {
    const Body& body = scene.bodies.all[b];
    scene.body_of.emplace(body.name, static_cast<int>(b));
    for (std::size_t j = 0; j < body.joints.size(); ++j) {
      const JointPart& joint = body.joints[j];  // a ball stands for its first part
      scene.joint_of.emplace(joint.ball.empty() ? joint.name : joint.ball, static_cast<int>(scene.joints.size()));
      scene.joints.push_back({static_cast<int>(b), static_cast<int>(j)});
    }
  }
  choose_bodies(scene);
  weigh(scene.bodies, scene.is_read, settings, options.leave_out_meshes, meshes, document.report());
  suspect_angles(scene);
  name_flexes(scene);
  resolve(scene);
  read_tendons(scene);
  read_equalities(scene);
  read_actuators(scene);
  scene.report().stop_if_refused();
  return scene;
}

}  // namespace lockstep::importer::mjcf
