// The walk through the trees. SPDX-License-Identifier: Apache-2.0
#include "bodies.h"

#include <algorithm>

#include "export/names.h"

namespace lockstep::exporter::mjcf {
namespace {

using Eigen::Isometry3d;

// By link that a joint moves: the one joint that its body without mass carries and nothing else, -1 if it is not so.
std::vector<int> only_joints(const Model& model, const Trees& trees) {
  const std::vector<Inertia> bodies = rigid_bodies(model, trees);
  std::vector<int> only(bodies.size(), -1), count(bodies.size(), 0);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    if (!model.joints[j].moves() || model.joints[j].kind == JointKind::tendon) continue;
    const auto carrier = static_cast<std::size_t>(trees.carrier[static_cast<std::size_t>(trees.joint_parent[j])]);
    only[carrier] = static_cast<int>(j);
    ++count[carrier];
  }
  const auto bears = [&](const std::string& link) {
    if (!link.empty())
      only[static_cast<std::size_t>(trees.carrier[static_cast<std::size_t>(model.link_index(link))])] = -1;
  };
  for (const Site& site : model.sites) bears(site.link);
  for (const Collider& collider : model.colliders) bears(collider.link);
  for (const Loop& loop : model.loops) bears(loop.first), bears(loop.second);
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if (count[i] != 1 || trees.parent_joint[i] < 0 || bodies[i].mass > 0.0 || !bodies[i].about_center.isZero(0.0))
      only[i] = -1;
  return only;
}

class Walk {
 public:
  Walk(const Model& model, const Trees& trees, Report& report)
      : model_(model), trees_(trees), report_(report), only_(only_joints(model, trees)) {}

  Layout lay_out() {
    std::vector<bool> folded;
    for (const int joint : only_) folded.push_back(joint >= 0);
    inertials_ = inertials(model_, trees_, folded, report_);
    layout_.is_world.assign(model_.links.size(), false);
    names_.take("world");
    for (std::size_t tree = 0; tree < trees_.roots.size(); ++tree) {
      const Root& root = trees_.roots[tree];
      const int link = trees_.root_link[tree];
      if (stands_for_world(root, model_)) {
        layout_.is_world[static_cast<std::size_t>(link)] = true;
        add_children(link, -1);
        continue;
      }
      if (!root.floating) report_.remark("bolted roots, written as bodies of the world", root.link);
      add_body(link, -1, root.pose, {}, root.floating);
    }
    return std::move(layout_);
  }

 private:
  const std::string& name(int link) const { return model_.links[static_cast<std::size_t>(link)].name; }

  void add_children(int link, int body) {
    for (const int j : trees_.child_joints[static_cast<std::size_t>(link)]) {
      const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
      const int child = trees_.joint_child[static_cast<std::size_t>(j)];
      if (joint.moves())
        move(child, body, joint.origin, {{j, Isometry3d::Identity()}});
      else
        add_body(child, body, joint.origin, {}, false);
      if (!joint.moves() && joint.name != joint.child)
        report_.remark("fixed joints, whose names MJCF does not have", joint.name);
    }
  }

  // The link is moved by the last of the joints; what they pass may have no mass.
  void move(int link, int parent, const Isometry3d& pose, std::vector<JointPlace> joints) {
    const int next = only_[static_cast<std::size_t>(link)];
    if (next < 0) return add_body(link, parent, pose, std::move(joints), false);
    for (std::size_t i = 0; i < model_.links.size(); ++i)
      if (trees_.carrier[i] == link)
        report_.remark("links without mass, left out: the next body has their joints", model_.links[i].name);
    const auto holder = static_cast<std::size_t>(trees_.joint_parent[static_cast<std::size_t>(next)]);
    const Isometry3d on = trees_.in_carrier[holder] * Isometry3d(model_.joints[static_cast<std::size_t>(next)].origin);
    for (JointPlace& place : joints) place.pose = on.inverse() * place.pose;
    joints.push_back({next, Isometry3d::Identity()});
    move(trees_.joint_child[static_cast<std::size_t>(next)], parent, pose * on, std::move(joints));
  }

  void add_body(int link, int parent, const Isometry3d& pose, std::vector<JointPlace> joints, bool floats) {
    const auto index = static_cast<int>(layout_.bodies.size());
    Body body{names_.take(name(link)), link,   pose,
              std::move(joints),       floats, inertials_[static_cast<std::size_t>(link)]};
    if (body.name != name(link)) report_.remark("links called otherwise, as the world is 'world'", body.name);
    layout_.bodies.push_back(std::move(body));
    (parent < 0 ? layout_.in_world : layout_.bodies[static_cast<std::size_t>(parent)].children).push_back(index);
    add_children(link, index);
  }

  const Model& model_;
  const Trees& trees_;
  Report& report_;
  const std::vector<int> only_;
  std::vector<Inertial> inertials_;
  Names names_;
  Layout layout_;
};

}  // namespace

bool stands_for_world(const Root& root, const Model& model) {
  const Inertia& inertia = model.links[static_cast<std::size_t>(model.link_index(root.link))].inertia;
  return root.link == "world" && !root.floating && root.pose.matrix().isIdentity(0.0) && inertia.mass == 0.0 &&
         inertia.about_center.isZero(0.0);
}

Layout lay_out(const Model& model, const Trees& trees, Report& report) { return Walk(model, trees, report).lay_out(); }

}  // namespace lockstep::exporter::mjcf
