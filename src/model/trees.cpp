// The trees of links and joints, and sums of inertias. SPDX-License-Identifier: Apache-2.0
#include "trees.h"

#include <map>

#include "lockstep/error.h"

namespace lockstep {
namespace {

std::map<std::string, int> indices(const std::vector<Link>& links) {
  std::map<std::string, int> result;
  for (std::size_t i = 0; i < links.size(); ++i) result.emplace(links[i].name, static_cast<int>(i));
  return result;
}

Eigen::Matrix3d parallel_axis(double mass, const Eigen::Vector3d& offset) {
  return mass * (offset.squaredNorm() * Eigen::Matrix3d::Identity() - offset * offset.transpose());
}

}  // namespace

Trees::Trees(const Model& model) {
  if (model.links.empty()) throw ModelError("model '" + model.name + "'", "has no links", "add at least one link");
  const std::map<std::string, int> link_of = indices(model.links);
  const std::size_t links = model.links.size(), joints = model.joints.size();
  parent_joint.assign(links, -1);
  child_joints.resize(links);
  for (std::size_t j = 0; j < joints; ++j) {
    const Joint& joint = model.joints[j];
    if (joint.kind == JointKind::tendon) {
      joint_parent.push_back(-1), joint_child.push_back(-1);
      continue;
    }
    for (const std::string& end : {joint.parent, joint.child})
      if (!link_of.count(end))
        throw ModelError("joint '" + joint.name + "'", "refers to link '" + end + "', which does not exist",
                         "add the link or correct the name");
    const int parent = link_of.at(joint.parent), child = link_of.at(joint.child);
    if (parent == child)
      throw ModelError("joint '" + joint.name + "'", "connects link '" + joint.parent + "' to itself",
                       "name two different links");
    if (parent_joint[child] >= 0)
      throw ModelError(
          "link '" + joint.child + "'",
          "is the child of two joints, '" + model.joints[parent_joint[child]].name + "' and '" + joint.name + "'",
          "cut the loop: lockstep models trees");
    parent_joint[child] = static_cast<int>(j);
    child_joints[parent].push_back(static_cast<int>(j));
    joint_parent.push_back(parent);
    joint_child.push_back(child);
  }
  find_roots(model, link_of);

  tree_of.assign(links, -1);
  carrier.assign(links, -1);
  in_carrier.assign(links, Eigen::Isometry3d::Identity());
  for (int tree = 0; tree < count(); ++tree) {
    const int root = root_link[tree];
    carrier[root] = root;
    tree_of[root] = tree;
    std::vector<int> stack(child_joints[root].rbegin(), child_joints[root].rend());
    while (!stack.empty()) {
      const int j = stack.back();
      stack.pop_back();
      joints_depth_first.push_back(j);
      const int parent = joint_parent[j], child = joint_child[j];
      tree_of[child] = tree;
      if (model.joints[j].moves()) {
        carrier[child] = child;
      } else {
        carrier[child] = carrier[parent];
        in_carrier[child] = in_carrier[parent] * model.joints[j].origin;
      }
      stack.insert(stack.end(), child_joints[child].rbegin(), child_joints[child].rend());
    }
  }
  for (std::size_t i = 0; i < links; ++i)
    if (tree_of[i] < 0)
      throw ModelError("link '" + model.links[i].name + "'", "is carried by a circle of joints, which has no root",
                       "cut the circle: lockstep models trees");
}

void Trees::find_roots(const Model& model, const std::map<std::string, int>& link_of) {
  roots = model.roots;
  std::vector<int> free;  // links that no joint carries
  for (std::size_t i = 0; i < model.links.size(); ++i)
    if (parent_joint[i] < 0) free.push_back(static_cast<int>(i));
  if (roots.empty() && free.size() == 1) roots.push_back({model.links[free[0]].name});
  if (roots.empty() && free.size() > 1) {
    std::string names;
    for (const int link : free) names += (names.empty() ? "'" : ", '") + model.links[link].name + "'";
    throw ModelError("model '" + model.name + "'", "has several links that no joint carries: " + names,
                     "connect them with joints, or name each in Model::roots if it is a tree of its own");
  }
  std::vector<bool> is_root(model.links.size());
  for (const Root& root : roots) {
    const std::string element = "root '" + root.link + "'";
    const auto found = link_of.find(root.link);
    if (found == link_of.end()) throw ModelError(element, "is no link of the model", "correct the name");
    if (is_root[static_cast<std::size_t>(found->second)])
      throw ModelError(element, "appears twice in Model::roots", "remove one of them");
    if (const int j = parent_joint[found->second]; j >= 0)
      throw ModelError(element, "is carried by joint '" + model.joints[j].name + "'",
                       "remove it from Model::roots, or remove the joint");
    root_link.push_back(found->second);
    is_root[static_cast<std::size_t>(found->second)] = true;
  }
  for (const int link : free)
    if (!is_root[static_cast<std::size_t>(link)])
      throw ModelError("link '" + model.links[link].name + "'", "is carried by no joint and is no root",
                       "connect it with a joint, or add it to Model::roots if it is a tree of its own");
}

Inertia operator+(const Inertia& a, const Inertia& b) {
  Inertia sum;
  sum.mass = a.mass + b.mass;
  if (sum.mass > 0.0) sum.center = (a.mass * a.center + b.mass * b.center) / sum.mass;
  sum.about_center = a.about_center + parallel_axis(a.mass, a.center - sum.center) + b.about_center +
                     parallel_axis(b.mass, b.center - sum.center);
  return sum;
}

Inertia transformed(const Inertia& inertia, const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d rotation = pose.linear();
  return {inertia.mass, pose * inertia.center, rotation * inertia.about_center * rotation.transpose()};
}

std::vector<Inertia> rigid_bodies(const Model& model, const Trees& trees) {
  std::vector<Inertia> sums(model.links.size());
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    Inertia& sum = sums[trees.carrier[i]];
    sum = sum + transformed(model.links[i].inertia, trees.in_carrier[i]);
  }
  return sums;
}

}  // namespace lockstep
