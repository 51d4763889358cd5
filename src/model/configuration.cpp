// SPDX-License-Identifier: Apache-2.0
#include "configuration.h"

#include "joint_motion.h"

namespace lockstep {

Configuration start_of(const Model& model, const Trees& trees) {
  Configuration at;
  for (const Joint& joint : model.joints) at.position.push_back(joint.moves() ? joint.position : 0.0);
  for (const Root& root : trees.roots) at.root.emplace_back(root.pose);
  return at;
}

std::vector<Eigen::Isometry3d> link_poses(const Model& model, const Trees& trees, const Configuration& at) {
  std::vector<Eigen::Isometry3d> poses(model.links.size());
  for (int tree = 0; tree < trees.count(); ++tree) poses[trees.root_link[tree]] = at.root[tree];
  for (const int j : trees.joints_depth_first)
    poses[trees.joint_child[j]] =
        poses[trees.joint_parent[j]] * Eigen::Isometry3d(model.joints[j].origin) *
        motion_of(model, j, [&](int of) { return at.position[static_cast<std::size_t>(of)]; });
  return poses;
}

}  // namespace lockstep
