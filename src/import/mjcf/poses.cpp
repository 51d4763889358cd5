// Keyframes as named poses. SPDX-License-Identifier: Apache-2.0
#include "poses.h"

#include <algorithm>

#include "model/by_name.h"
#include "model/poses.h"
#include "model/tendons.h"

namespace lockstep::importer::mjcf {
namespace {

// Targets and efforts of all joints that actuators act on.
void aim_drives(const Scene& scene, const Key& key, const std::vector<Control>& controls, const Model& model,
                NamedPose& pose) {
  Model there = started_in(pose, model);
  place_tendons(there);
  const bool has_controls = !key.start.control.empty();
  for (const auto& [number, aim, scale, shift, actuator] : controls) {
    const Joint& joint = there.joints[static_cast<std::size_t>(number)];
    const double force = shift + (has_controls ? scale * control_at(scene, key.start, actuator) : 0.0);
    switch (aim) {
      case Control::Aim::position:
        if (has_controls)
          pose.position_targets[joint.name] += force / joint.drive.kp;
        else
          pose.position_targets[joint.name] = joint.position;
        break;
      case Control::Aim::velocity:
        pose.velocity_targets[joint.name] += has_controls ? force / joint.drive.kd : 0.0;
        break;
      case Control::Aim::effort: pose.efforts[joint.name] += force; break;
    }
  }
}

}  // namespace

void add_poses(const Scene& scene, const Start& start, const std::vector<Key>& keys,
               const std::vector<Control>& controls, Draft& draft) {
  Model& model = draft.model;
  const ByName joints(model.joints);
  const Model bare = model;  // without the poses of all keys before
  for (const Key& key : keys) {
    NamedPose pose{key.name};
    for (std::size_t j = 0; j < scene.joints.size(); ++j) {
      const std::string& name = scene.joint(static_cast<int>(j)).name;
      const int joint = joints.find(name);
      if (!scene.is_joint_read(static_cast<int>(j)) || joint < 0 ||
          !model.joints[static_cast<std::size_t>(joint)].moves())
        continue;
      pose.positions[name] = key.start.position[j], pose.velocities[name] = key.start.velocity[j];
    }
    for (const auto& [body, at] : key.start.pose) {
      const Body& own = scene.bodies.all[static_cast<std::size_t>(body)];
      const auto root =
          std::find_if(model.roots.begin(), model.roots.end(), [&](const Root& r) { return r.link == own.name; });
      if (own.is_mocap && !at.isApprox(start.pose.at(body), 0.0))
        scene.report().warn("poses of mocap bodies, left out of keyframes that are not the start", key.name);
      if (root == model.roots.end() || !root->floating) continue;
      pose.root_poses[own.name] = at;
      const auto twist = key.start.twist.find(body);
      pose.root_velocities[own.name] = twist == key.start.twist.end() ? Twist(Twist::Zero()) : twist->second;
    }
    aim_drives(scene, key, controls, bare, pose);
    model.poses.push_back(std::move(pose));
  }
}

}  // namespace lockstep::importer::mjcf
