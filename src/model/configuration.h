// Where the links of a Model are, and what moves them. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "lockstep/model.h"
#include "trees.h"

namespace lockstep {

/// A pose of the model, of its joints and its trees.
struct Configuration {
  std::vector<double> position;         ///< by joint of the model, rad or m
  std::vector<Eigen::Isometry3d> root;  ///< by tree
};
Configuration start_of(const Model& model, const Trees& trees);

/// By link: its frame in the world.
std::vector<Eigen::Isometry3d> link_poses(const Model& model, const Trees& trees, const Configuration& at);

/// act(column, turning, moving): how fast a link turns, and a point of it moves, with each joint that carries it, and
/// with an angular velocity and a velocity of its floating root. All in the world; columns are the joints of the
/// model, and then six by tree.
template <class Act>
void each_motion(const Model& model, const Trees& trees, const std::vector<Eigen::Isometry3d>& poses, int link,
                 const Eigen::Vector3d& point, const Act& act) {
  for (int carried = link;;) {
    const int j = trees.parent_joint[carried];
    if (j < 0) break;
    const Joint& joint = model.joints[j];
    const Eigen::Isometry3d& pose = poses[carried];
    const Eigen::Vector3d axis = pose.linear() * joint.axis.normalized();
    if (joint.kind == JointKind::prismatic)
      act(j, Eigen::Vector3d::Zero(), axis);
    else if (joint.moves())
      act(j, axis, axis.cross(point - pose.translation()));
    carried = trees.joint_parent[j];
  }
  const int tree = trees.tree_of[link];
  if (!trees.roots[tree].floating) return;
  const Eigen::Index first = static_cast<Eigen::Index>(model.joints.size()) + 6 * tree;
  const Eigen::Vector3d arm = point - poses[trees.root_link[tree]].translation();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
    act(first + k, axis, axis.cross(arm));
    act(first + 3 + k, Eigen::Vector3d::Zero(), axis);
  }
}

}  // namespace lockstep
