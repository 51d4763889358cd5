// The trees that a Model's links and joints form. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "lockstep/model.h"

namespace lockstep {

/// Links and joints by index. Throws ModelError unless they form trees, and Model::roots has a root for each.
struct Trees {
  explicit Trees(const Model& model);

  std::vector<Root> roots;                     ///< by tree: Model::roots, or the one that it leaves out
  std::vector<int> root_link;                  ///< by tree
  std::vector<int> tree_of;                    ///< by link
  std::vector<int> parent_joint;               ///< by link: the joint that carries it, -1 for a root
  std::vector<std::vector<int>> child_joints;  ///< by link, in the model's order
  std::vector<int> joint_parent, joint_child;  ///< by joint: links; -1 for a tendon
  std::vector<int> carrier;                    ///< by link: itself or the nearest link up the tree that is a root or
                                               ///< is carried by a moving joint; both belong to one rigid body
  std::vector<Eigen::Isometry3d> in_carrier;   ///< by link: its frame in its carrier's
  std::vector<int> joints_depth_first;         ///< all but tendons, tree by tree, parents before children

  int count() const { return static_cast<int>(roots.size()); }
  /// Whether the body of a link stands still in the world.
  bool is_bolted(int link) const { return parent_joint[carrier[link]] < 0 && !roots[tree_of[link]].floating; }

 private:
  void find_roots(const Model& model, const std::map<std::string, int>& link_of);
};

/// The sum of two inertias in the same frame.
Inertia operator+(const Inertia& a, const Inertia& b);

/// The inertia in the frame in which `pose` places its present frame.
Inertia transformed(const Inertia& inertia, const Eigen::Isometry3d& pose);

/// By link: the inertia of the rigid body that a carrier and the links fixed to it form, in the carrier's frame. Zero
/// for links that are not carriers.
std::vector<Inertia> rigid_bodies(const Model& model, const Trees& trees);

}  // namespace lockstep
