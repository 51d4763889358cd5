// The tree that a Model's links and joints form. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// Links and joints by index. Throws ModelError where they are no single tree rooted at links[0].
struct Tree {
  explicit Tree(const Model& model);

  std::vector<int> parent_joint;               ///< by link: the joint that carries it, -1 for the root
  std::vector<std::vector<int>> child_joints;  ///< by link, in the model's order
  std::vector<int> joint_parent, joint_child;  ///< by joint: links
  std::vector<int> carrier;                    ///< by link: the first link up the tree (itself included) that a
                                               ///< moving joint carries, or the root: they form one rigid body
  std::vector<Eigen::Isometry3d> in_carrier;   ///< by link: its frame in its carrier's
  std::vector<int> joints_depth_first;         ///< all joints, parents before children
};

/// Sum of two inertias given in the same frame.
Inertia operator+(const Inertia& a, const Inertia& b);

/// The same body described in the frame in which `pose` places the one it is given in.
Inertia transformed(const Inertia& inertia, const Eigen::Isometry3d& pose);

/// By carrier: the rigid body that it and the links fixed to it form, in its axes. Nothing for the other links.
std::vector<Inertia> rigid_bodies(const Model& model, const Tree& tree);

}  // namespace lockstep
