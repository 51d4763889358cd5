// The tree that a Model's links and joints form. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// Links and joints by index. Throws ModelError unless they form one tree whose root is links[0].
struct Tree {
  explicit Tree(const Model& model);

  std::vector<int> parent_joint;               ///< by link: the joint that carries it, -1 for the root
  std::vector<std::vector<int>> child_joints;  ///< by link, in the model's order
  std::vector<int> joint_parent, joint_child;  ///< by joint: links
  std::vector<int> carrier;                    ///< by link: itself or the nearest link up the tree that is the root or
                                               ///< is carried by a moving joint; both belong to one rigid body
  std::vector<Eigen::Isometry3d> in_carrier;   ///< by link: its frame in its carrier's
  std::vector<int> joints_depth_first;         ///< all joints, parents before children
};

/// The sum of two inertias in the same frame.
Inertia operator+(const Inertia& a, const Inertia& b);

/// The inertia in the frame in which `pose` places its present frame.
Inertia transformed(const Inertia& inertia, const Eigen::Isometry3d& pose);

/// By link: the inertia of the rigid body that a carrier and the links fixed to it form, in the carrier's frame. Zero
/// for links that are not carriers.
std::vector<Inertia> rigid_bodies(const Model& model, const Tree& tree);

}  // namespace lockstep
