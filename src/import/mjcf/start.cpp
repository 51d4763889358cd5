// <keyframe>. SPDX-License-Identifier: Apache-2.0
#include "start.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>

#include "lockstep/error.h"
#include "model/rotations.h"
#include "names.h"

namespace lockstep::importer::mjcf {
namespace {

// The first part of a ball has its quaternion.
std::size_t positions_of(const JointPart& joint) {
  if (joint.type == JointType::ball) return joint.part() == 0 ? 4 : 0;
  return joint.type == JointType::free ? 7 : 1;
}
std::size_t velocities_of(const JointPart& joint) { return joint.type == JointType::free ? 6 : 1; }

// All numbers of an attribute; empty if it is not there.
std::vector<double> exactly(const Element& key, const char* attribute, std::size_t count) {
  if (!key.has(attribute)) return {};
  std::vector<double> values = key.all_numbers(attribute, std::max<std::size_t>(count, 100000));
  if (values.size() != count)
    key.fail(fmt::format("{} has {}, not {}", attribute, counted(values.size(), "number"), count),
             "give one for each coordinate of the file, in its order");
  return values;
}

// MuJoCo aligns only bodies that carry no other.
bool moves_principal_axes(const Scene& scene, int joint) {
  return scene.joint(joint).is_aligned &&
         std::none_of(scene.bodies.all.begin(), scene.bodies.all.end(), [&](const Body& body) {
           return body.parent == scene.joints[static_cast<std::size_t>(joint)].body;
         });
}

Eigen::Matrix3d turn_of(const double* wxyz, const char* attribute, const Element& key) {
  const Eigen::Vector4d turn(wxyz[1], wxyz[2], wxyz[3], wxyz[0]);
  if (!(turn.stableNorm() > 1e-14))
    key.fail(fmt::format("{} has a quaternion without length", attribute), "give a unit quaternion");
  return Eigen::Quaterniond(Eigen::Vector4d(turn.stableNormalized())).toRotationMatrix();
}

void place_mocaps(const Element& key, const Scene& scene, Start& start) {
  std::vector<int> mocaps;
  for (std::size_t b = 0; b < scene.bodies.all.size(); ++b)
    if (scene.bodies.all[b].is_mocap) mocaps.push_back(static_cast<int>(b));
  const std::vector<double> at = exactly(key, "mpos", 3 * mocaps.size()),
                            turns = exactly(key, "mquat", 4 * mocaps.size());
  for (std::size_t m = 0; m < mocaps.size(); ++m) {
    Eigen::Isometry3d& pose = start.pose.at(mocaps[m]);
    if (!at.empty()) pose.translation() = Eigen::Vector3d(at[3 * m], at[3 * m + 1], at[3 * m + 2]);
    if (!turns.empty()) pose.linear() = turn_of(&turns[4 * m], "mquat", key);
  }
}

void apply(const Element& key, const Scene& scene, Start& start) {
  std::size_t positions = 0, velocities = 0;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    positions += positions_of(scene.joint(static_cast<int>(j)));
    velocities += velocities_of(scene.joint(static_cast<int>(j)));
  }
  const std::vector<double> q = exactly(key, "qpos", positions), v = exactly(key, "qvel", velocities);
  start.control = exactly(key, "ctrl", scene.actuators.size());
  if (key.has("act")) scene.report().warn("parts of the keyframe, left out", "act");
  place_mocaps(key, scene, start);
  key.has("time");
  const double *position = q.data(), *velocity = v.data();
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const JointPart& joint = scene.joint(static_cast<int>(j));
    const JointType type = joint.type;
    const int body = scene.joints[j].body;
    if (moves_principal_axes(scene, static_cast<int>(j)) && !(q.empty() && v.empty()))
      key.fail(fmt::format("moves body '{}' by its principal axes, as align or alignfree say",
                           scene.bodies.all[static_cast<std::size_t>(body)].name),
               "set align=\"false\", and give the pose of the body's own axes");
    if (type == JointType::free && !q.empty()) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = Eigen::Vector3d(position[0], position[1], position[2]);
      pose.linear() = turn_of(position + 3, "qpos", key);
      start.pose[body] = pose;
    } else if (type == JointType::ball && joint.part() == 0 && !q.empty()) {
      const Eigen::Vector3d turn = rotation_vector(Eigen::Quaterniond(turn_of(position, "qpos", key)));
      std::copy_n(turn.data(), 3, &start.position[j]);
    } else if (type != JointType::ball && !q.empty()) {
      start.position[j] = *position;
    }
    if (type == JointType::free && !v.empty()) {  // MuJoCo: linear in world axes, then angular in the body's
      Twist twist;
      twist << velocity[3], velocity[4], velocity[5],
          start.pose[body].linear().transpose() * Eigen::Vector3d(velocity[0], velocity[1], velocity[2]);
      start.twist[body] = twist;
    } else if (type != JointType::free && !v.empty()) {
      start.velocity[j] = *velocity;
    }
    if (!q.empty()) position += positions_of(joint);
    if (!v.empty()) velocity += velocities_of(joint);
  }
}

Start drawn(const Scene& scene) {
  Start start;
  for (std::size_t j = 0; j < scene.joints.size(); ++j) {
    const Body& body = scene.bodies.all[static_cast<std::size_t>(scene.joints[j].body)];
    start.position.push_back(scene.joint(static_cast<int>(j)).ref);
    if (body.floats()) start.pose[scene.joints[j].body] = body.in_world;
  }
  for (std::size_t b = 0; b < scene.bodies.all.size(); ++b)
    if (scene.bodies.all[b].is_mocap) start.pose[static_cast<int>(b)] = scene.bodies.all[b].in_world;
  start.velocity.resize(scene.joints.size());
  return start;
}

// The number of the key of the options; that of none without the option.
std::size_t chosen_key(const std::string& wanted, const std::vector<std::string>& names) {
  if (wanted.empty()) return names.size();
  for (std::size_t k = 0; k < names.size(); ++k)
    if (names[k] == wanted) return k;
  for (std::size_t k = 0; k < names.size(); ++k)
    if (std::to_string(k) == wanted) return k;
  throw SettingsError("ImportOptions::keyframe", "names '" + shortened(wanted) + "', which is no key of the file",
                      names.empty() ? "leave it out, the file has none" : "give one of " + listed(names));
}

}  // namespace

std::vector<Key> read_keys(const Scene& scene) {
  std::vector<Element> elements;
  std::vector<std::string> names;
  for (const Element::Xml* xml : scene.document.section("keyframe")) {
    if (std::string_view(xml->Name()) != "key") continue;
    if (scene.document.part_of(*xml) > 0) {
      scene.report().warn("keyframes of attached models, left out", Element(scene.document, *xml).place());
      continue;
    }
    const char* name = xml->Attribute("name");
    names.push_back(name ? name : std::to_string(names.size()));
    elements.emplace_back(scene.document, *xml);
    elements.back().rename("key '" + shortened(names.back()) + "'");
  }
  const std::size_t chosen = chosen_key(scene.options.keyframe, names);
  Names taken;
  std::vector<Key> keys;
  for (std::size_t k = 0; k < names.size(); ++k) {
    Key key{taken.unused(names[k]), drawn(scene), k == chosen};
    try {
      apply(elements[k], scene, key.start);
    } catch (const ImportError& error) {
      if (key.is_chosen) throw;
      scene.report().warn("keyframes that do not fit, left out", key.name + " " + error.rule());
      continue;
    }
    scene.report().remark("keyframes, kept as poses", key.name);
    keys.push_back(std::move(key));
  }
  return keys;
}

Start start_of(const Scene& scene, const std::vector<Key>& keys) {
  for (const Key& key : keys)
    if (key.is_chosen) return key.start;
  return drawn(scene);
}

}  // namespace lockstep::importer::mjcf
