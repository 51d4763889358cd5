// The tree of links and joints, and sums of inertias. SPDX-License-Identifier: Apache-2.0
#include "tree.h"

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

Tree::Tree(const Model& model) {
  if (model.links.empty()) throw ModelError("model '" + model.name + "'", "has no links", "add at least the root link");
  const std::map<std::string, int> link_of = indices(model.links);
  const std::size_t links = model.links.size(), joints = model.joints.size();
  parent_joint.assign(links, -1);
  child_joints.resize(links);
  for (std::size_t j = 0; j < joints; ++j) {
    const Joint& joint = model.joints[j];
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
  if (parent_joint[0] >= 0)
    throw ModelError(
        "link '" + model.links[0].name + "'",
        "is the first link and so the root, yet joint '" + model.joints[parent_joint[0]].name + "' carries it",
        "put the root link first");

  carrier.assign(links, -1);
  in_carrier.assign(links, Eigen::Isometry3d::Identity());
  carrier[0] = 0;
  std::vector<int> stack(child_joints[0].rbegin(), child_joints[0].rend());
  while (!stack.empty()) {
    const int j = stack.back();
    stack.pop_back();
    joints_depth_first.push_back(j);
    const int parent = joint_parent[j], child = joint_child[j];
    if (model.joints[j].moves()) {
      carrier[child] = child;
    } else {
      carrier[child] = carrier[parent];
      in_carrier[child] = in_carrier[parent] * model.joints[j].origin;
    }
    stack.insert(stack.end(), child_joints[child].rbegin(), child_joints[child].rend());
  }
  for (std::size_t i = 0; i < links; ++i)
    if (carrier[i] < 0)
      throw ModelError("link '" + model.links[i].name + "'",
                       "is not connected to the root '" + model.links[0].name + "'",
                       "connect it with a joint or remove it");
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

std::vector<Inertia> rigid_bodies(const Model& model, const Tree& tree) {
  std::vector<Inertia> sums(model.links.size());
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    Inertia& sum = sums[tree.carrier[i]];
    sum = sum + transformed(model.links[i].inertia, tree.in_carrier[i]);
  }
  return sums;
}

}  // namespace lockstep
