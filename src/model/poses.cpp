// Named poses: rules, and the model that starts in one. SPDX-License-Identifier: Apache-2.0
#include "poses.h"

#include <algorithm>

#include "rules.h"

namespace lockstep {
namespace {

using std::string;

template <class Number>
void proper_joints(const Model& model, const std::map<string, Number>& by_joint, const string& element,
                   const string& what, bool of_tendons_too) {
  for (const auto& [name, value] : by_joint) {
    const auto joint =
        std::find_if(model.joints.begin(), model.joints.end(), [&own = name](const Joint& j) { return j.name == own; });
    require(joint != model.joints.end(), element, "has a " + what + " of joint '" + name + "', which does not exist",
            "correct the name");
    require(joint->moves(), element, "has a " + what + " of joint '" + name + "', which is fixed",
            "name moving joints alone");
    require(of_tendons_too || joint->kind != JointKind::tendon, element,
            "has a " + what + " of tendon '" + name + "', which has that of its joints", "name the tendon's joints");
    finite(value, element, what + " of joint '" + name + "'");
  }
}

template <class Value>
void proper_roots(const Model& model, const std::map<string, Value>& by_link, const string& element,
                  const string& what) {
  for (const auto& [link, value] : by_link) {
    const auto root =
        std::find_if(model.roots.begin(), model.roots.end(), [&own = link](const Root& r) { return r.link == own; });
    require(root != model.roots.end(), element, "has a " + what + " of '" + link + "', which is no root of the model",
            "name the root link of a tree in Model::roots");
    require(root->floating, element, "has a " + what + " of root '" + link + "', which is bolted",
            "let the root float, or leave it out of the pose");
  }
}

}  // namespace

void proper_pose(const Model& model, const NamedPose& pose) {
  const string element = quoted("pose", pose.name);
  proper_joints(model, pose.positions, element, "position", false);
  proper_joints(model, pose.velocities, element, "velocity", false);
  proper_joints(model, pose.position_targets, element, "position target", true);
  proper_joints(model, pose.velocity_targets, element, "velocity target", true);
  proper_joints(model, pose.efforts, element, "effort", true);
  proper_roots(model, pose.root_poses, element, "pose");
  proper_roots(model, pose.root_velocities, element, "velocity");
  for (const auto& [link, at] : pose.root_poses) rigid(at, element, "pose of root '" + link + "'");
  for (const auto& [link, twist] : pose.root_velocities) finite(twist, element, "velocity of root '" + link + "'");
}

Model started_in(const NamedPose& pose, Model model) {
  const auto take = [](const auto& values, const string& name, auto& to) {
    const auto found = values.find(name);
    if (found != values.end()) to = found->second;
    return found != values.end();
  };
  for (Joint& joint : model.joints) {
    if (take(pose.positions, joint.name, joint.position) && (joint.drive.kp > 0.0 || joint.drive.kinematic))
      joint.drive.position_target = joint.position;
    take(pose.velocities, joint.name, joint.velocity);
    take(pose.position_targets, joint.name, joint.drive.position_target);
    take(pose.velocity_targets, joint.name, joint.drive.velocity_target);
    take(pose.efforts, joint.name, joint.effort);
  }
  for (Root& root : model.roots) {
    take(pose.root_poses, root.link, root.pose);
    take(pose.root_velocities, root.link, root.velocity);
  }
  return model;
}

}  // namespace lockstep
