// Links by the joint that carries their body. SPDX-License-Identifier: Apache-2.0
#include "mechanism.h"

#include <algorithm>
#include <cmath>

#include "model/contact_pairs.h"
#include "model/softness_numbers.h"
#include "model/trees.h"

namespace lockstep {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using std::string;

class Reading {
 public:
  Reading(const Model& model, const Except& except) : model_(model), trees_(model), except_(except) {
    in_world_.resize(model.links.size());
    for (std::size_t tree = 0; tree < trees_.roots.size(); ++tree)
      in_world_[at(trees_.root_link[tree])] = trees_.roots[tree].pose;
    for (const int j : trees_.joints_depth_first)
      in_world_[at(trees_.joint_child[at(j)])] = in_world_[at(trees_.joint_parent[at(j)])] * model.joints[at(j)].origin;
  }

  Mechanism read() {
    add("gravity", model_.gravity);
    for (const Root& root : trees_.roots)
      if (root.floating) add("root " + root.link, root.pose.matrix()), add("root " + root.link, root.velocity);
    for (std::size_t j = 0; j < model_.joints.size(); ++j)
      if (model_.joints[j].moves()) add_joint(static_cast<int>(j));
    add_bodies();
    add_couplings();
    for (const Loop& loop : model_.loops) add_loop(loop);
    if (!except_.sites)
      for (const Site& site : model_.sites) {
        const int link = model_.link_index(site.link);
        add("site " + site.name + " on " + carrier(link), (in_world_[at(link)] * Isometry3d(site.pose)).matrix());
      }
    if (!except_.colliders) add_contacts();
    return std::move(found_);
  }

 private:
  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  template <class Matrix>
  void add(const string& name, const Matrix& values) {
    std::vector<double>& to = found_[name];
    for (Eigen::Index c = 0; c < values.cols(); ++c)
      for (Eigen::Index r = 0; r < values.rows(); ++r) to.push_back(values(r, c));
  }
  void append(const string& name, std::initializer_list<double> values) {
    found_[name].insert(found_[name].end(), values);
  }

  // The joint or the floating root that carries a link's body; empty for the world.
  string carrier(int link) const {
    const int body = trees_.carrier[at(link)], joint = trees_.parent_joint[at(body)];
    if (joint >= 0) return "joint " + model_.joints[at(joint)].name;
    return trees_.is_bolted(body) ? "world" : "root " + model_.links[at(body)].name;
  }

  // A bound of 1e10 is none.
  static double bound(double value) { return std::abs(value) >= 1e10 ? std::copysign(infinity, value) : value; }

  void add_joint(int index) {
    const Joint& joint = model_.joints[at(index)];
    const string name = "joint " + joint.name;
    const bool is_tendon = joint.kind == JointKind::tendon;
    if (is_tendon)
      found_[name + " is a tendon"];
    else
      add_axis(index, name);
    for (const TendonSegment& segment : joint.path) add_segment(segment, name + " over ");
    const Drive& drive = joint.drive;
    append(name,
           {joint.damping, joint.armature, joint.friction, joint.stiffness, joint.stiffness * joint.rest, drive.kp,
            drive.kd, drive.kp * drive.position_target, drive.kd * drive.velocity_target, joint.effort});
    if (!is_tendon) append(name, {joint.position, joint.velocity});
    append(name + " bounds", {bound(joint.lower), bound(joint.upper), bound(joint.effort_limit)});
    if (is_tendon)
      append(name + " slack",
             {std::get_if<Spring>(&joint.limit_softness) ? std::get<Spring>(joint.limit_softness).kp : infinity});
  }

  // The bodies of its ends and where these are in the drawn pose.
  void add_segment(const TendonSegment& segment, const string& name) {
    const auto end = [&](const string& link, const Vector3d& at) {
      const int index = link.empty() ? -1 : model_.link_index(link);
      const Vector3d place = index < 0 ? at : in_world_[static_cast<std::size_t>(index)] * at;
      add(name + (index < 0 ? "world" : carrier(index)), place);
    };
    end(segment.first, segment.first_point), end(segment.second, segment.second_point);
    append(name + "shares", {segment.share});
  }

  void add_axis(int index, const string& name) {
    const Joint& joint = model_.joints[at(index)];
    const Isometry3d& frame = in_world_[at(trees_.joint_child[at(index)])];
    const bool slides = joint.kind == JointKind::prismatic;
    const Vector3d axis = frame.linear() * joint.axis.normalized();
    found_[name + (slides ? " slides on " : " turns on ") + carrier(trees_.joint_parent[at(index)])];
    add(name, axis);
    if (!slides) add(name, frame.translation().cross(axis));
  }

  void add_bodies() {
    std::map<string, Eigen::Vector4d> weights;  // with their moments, of links that move
    for (std::size_t i = 0; i < model_.links.size(); ++i) {
      const Link& link = model_.links[i];
      if (trees_.is_bolted(trees_.carrier[i]) || link.inertia.mass == 0.0) continue;
      const int body = trees_.carrier[i];
      const Vector3d center = in_world_[at(body)] * trees_.in_carrier[i] * link.inertia.center;
      weights.try_emplace(carrier(body), Eigen::Vector4d::Zero()).first->second +=
          link.gravity * link.inertia.mass * center.homogeneous();
    }
    for (const auto& [name, weight] : weights) add("weight on " + name, weight);

    std::map<string, Inertia> sums;
    const std::vector<Inertia> bodies = rigid_bodies(model_, trees_);
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      Inertia& sum = sums[carrier(static_cast<int>(i))];
      sum = sum + transformed(bodies[i], in_world_[i]);
    }
    for (const auto& [name, sum] : sums) {
      if (sum.mass == 0.0 && sum.about_center.isZero(0.0)) continue;
      append("body on " + name, {sum.mass});
      add("body on " + name, sum.center);
      add("body on " + name, Eigen::Matrix3d(0.5 * (sum.about_center + sum.about_center.transpose())));
    }
  }

  void add_couplings() {
    std::map<string, int> count;
    for (const Coupling& coupling : model_.couplings) {
      const bool hard = is_hard(coupling.softness) || except_.softness;
      if (is_absent(coupling.softness)) continue;
      string name = (hard ? "hard " : "soft ") + coupling.joint;
      name += "#" + std::to_string(++count[name]);
      for (const CouplingTerm& term : coupling.terms) append(name + " to " + term.joint, {term.ratio});
      append(name, {coupling.offset});
      if (coupling.function) found_[name + " by a polynomial"] = std::get<Polynomial>(*coupling.function).coefficients;
      const SoftnessNumbers softness = numbers_of(coupling.softness);
      if (!hard) append(name, {softness.first, softness.second});
    }
  }

  // What it holds: a point or two of an axis by their places on both bodies, or the one body's frame in the other's.
  void add_loop(const Loop& loop) {
    const auto end = [&](const string& link, const Pose& pose) {
      if (link.empty()) return std::pair{string("world"), Isometry3d(pose)};
      const int index = model_.link_index(link);
      return std::pair{carrier(index), in_world_[at(index)] * Isometry3d(pose)};
    };
    const auto [first, one] = end(loop.first, loop.first_pose);
    const auto [second, other] = end(loop.second, loop.second_pose);
    const string name = "loop " + loop.name + " from " + first + " to " + second;
    add(name, Vector3d(one.translation())), add(name, Vector3d(other.translation()));
    if (loop.kind == LoopKind::weld) add(name, Eigen::Matrix3d(one.linear() * other.linear().transpose()));
    if (loop.kind == LoopKind::hinge || loop.kind == LoopKind::slider)
      for (const Isometry3d& frame : {one, other}) add(name, Vector3d(frame.linear() * loop.axis.normalized()));
    found_[name + " is a " + to_string(loop.kind)];
  }

  // Colliders that touch, as no other matters.
  void add_contacts() {
    for (const ColliderPair& pair : contact_pairs(model_, trees_).pairs) {
      for (const int c : {pair.first, pair.second}) {
        const Collider& collider = model_.colliders[at(c)];
        const int link = collider.link.empty() ? -1 : model_.link_index(collider.link);
        const string name = "collider " + collider.name + " on " + (link < 0 ? "world" : carrier(link)) + " of kind " +
                            std::to_string(static_cast<int>(collider.shape.kind));
        if (found_.contains(name)) continue;
        add(name, collider.shape.size);
        add(name, ((link < 0 ? Isometry3d::Identity() : in_world_[at(link)]) * Isometry3d(collider.pose)).matrix());
      }
      append("pair " + pair_name(model_, pair), {pair.friction, pair.torsional_friction, pair.rolling_friction});
      if (const auto* spring = std::get_if<Spring>(&pair.softness))
        append("softness of " + pair_name(model_, pair), {spring->kp, spring->kd});
    }
  }

  const Model& model_;
  const Trees trees_;
  const Except except_;
  std::vector<Isometry3d> in_world_;
  Mechanism found_;
};

}  // namespace

Mechanism mechanism_of(const Model& model, const Except& except) { return Reading(model, except).read(); }

void expect_same(const Mechanism& own, const Mechanism& wanted, double tolerance) {
  for (const auto& [name, numbers] : own) EXPECT_TRUE(wanted.contains(name)) << name << " is too much";
  for (const auto& [name, numbers] : wanted) {
    const auto found = own.find(name);
    if (found == own.end() || found->second.size() != numbers.size()) {
      ADD_FAILURE() << name << " is missing, or has other numbers";
      continue;
    }
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const double a = found->second[i], b = numbers[i];
      if (a == b) continue;
      EXPECT_LE(std::abs(a - b), tolerance * std::max({1.0, std::abs(a), std::abs(b)}))
          << name << ", number " << i << ": " << a << " in place of " << b;
    }
  }
}

}  // namespace lockstep
