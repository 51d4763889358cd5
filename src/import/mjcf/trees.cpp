// Trees of links. SPDX-License-Identifier: Apache-2.0
#include "trees.h"

#include <fmt/format.h>

#include "lockstep/error.h"
#include "model/trees.h"
#include "names.h"
#include "pose.h"

namespace lockstep::importer::mjcf {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

class Grower {
 public:
  Grower(const Scene& scene, const Start& start, Draft& draft)
      : scene_(scene), start_(start), draft_(draft), places_(scene.bodies.all.size()) {
    for (const Body& body : scene.bodies.all) {
      links_.take(body.name);
      for (const JointPart& joint : body.joints) joints_.take(joint.name);
    }
  }

  std::vector<Place> grow() {
    has_world_ = needs_world();
    if (has_world_) {
      draft_.model.links.push_back({"world", {}});
      draft_.model.roots.push_back({"world"});
      places_[0].link = "world";
    }
    for (std::size_t b = 1; b < places_.size(); ++b)
      if (scene_.is_read[b]) add(b);
    add_sites(0);
    return std::move(places_);
  }

 private:
  const Body& body(std::size_t b) const { return scene_.bodies.all[b]; }
  // Of the bodies that are read.
  bool is_top(std::size_t b) const {
    return body(b).parent == 0 || !scene_.is_read[static_cast<std::size_t>(body(b).parent)];
  }
  Report& report() const { return scene_.report(); }

  // Something stands on the world and moves, or nothing floats.
  bool needs_world() const {
    bool floats = false, stands = false;
    std::vector<bool> is_bolted(places_.size(), true);
    for (std::size_t b = 1; b < places_.size(); ++b) {
      if (!scene_.is_read[b]) continue;
      is_bolted[b] = !body(b).floats() && (is_top(b) || is_bolted[static_cast<std::size_t>(body(b).parent)]);
      floats = floats || body(b).floats();
      stands = stands || (is_bolted[b] && !body(b).joints.empty());
    }
    return stands || !floats;
  }

  void add(std::size_t b) {
    const Body& own = body(b);
    judge(b);
    const auto parent = static_cast<std::size_t>(own.parent);
    const Place carrier = is_top(b) ? Place{has_world_ ? "world" : "", Isometry3d::Identity()} : places_[parent];
    const Isometry3d pose = is_top(b) ? own.in_world : own.pose;
    if (own.is_mocap) return add_mocap(b);
    if (own.floats()) {
      add_root(b);
    } else if (!has_world_ && carrier.link.empty()) {
      places_[b].pose = carrier.pose * pose;
      report().remark("bodies that stand still beside floating ones, left out", own.name);
      return lose_mass(own);
    } else {
      add_joints(b, carrier, pose);
    }
    add_sites(b);
  }

  void add_mocap(std::size_t b) {
    places_[b] = {places_[0].link, start_.pose.at(static_cast<int>(b))};
    report().warn("mocap bodies, part of the world: Parameter::loop_frame moves their loops, not their geoms",
                  body(b).name);
    lose_mass(body(b));
    add_sites(b);
  }

  void lose_mass(const Body& own) const {
    if (own.inertia.mass > 0.0)
      report().tally("masses of bodies that stand still, left out", fmt::format("{:g} kg", own.inertia.mass));
  }

  void judge(std::size_t b) const {
    const Body& own = body(b);
    for (const std::string& place : own.mesh_masses)
      if (scene_.bodies.moves[b])
        report().warn("meshes that give moving bodies no inertia, left out on request", place);
      else
        report().remark("meshes that give bodies that stand still no mass, as they are not opened", place);
  }

  void add_link(const std::string& name, const Inertia& inertia, double gravity, const std::string& place) {
    draft_.places["link '" + name + "'"] = place;
    draft_.model.links.push_back({name, inertia, gravity});
  }

  void add_root(std::size_t b) {
    const Body& own = body(b);
    add_link(own.name, own.inertia, own.gravity, own.place);
    draft_.places["root '" + own.name + "'"] = own.place;
    Root root{own.name, true, start_.pose.at(static_cast<int>(b)), Twist::Zero()};
    if (const auto twist = start_.twist.find(static_cast<int>(b)); twist != start_.twist.end())
      root.velocity = twist->second;
    draft_.model.roots.push_back(root);
    places_[b].link = own.name;
  }

  // One link for each joint, or one fixed link; the body's own inertia is on the last.
  void add_joints(std::size_t b, const Place& carrier, const Isometry3d& pose) {
    const Body& own = body(b);
    Isometry3d origin = carrier.pose * pose;
    std::string parent = carrier.link;
    Vector3d anchor = Vector3d::Zero();
    for (std::size_t j = 0; j < own.joints.size(); ++j) {
      const JointPart& part = own.joints[j];
      const bool is_last = j + 1 == own.joints.size();
      const bool turns = part.type != JointType::slide;
      const Vector3d next = turns ? part.anchor : anchor;
      origin = origin * shift(next - anchor);
      anchor = next;
      origin = turns ? Isometry3d(origin * Eigen::AngleAxisd(-part.ref, part.axis))
                     : Isometry3d(origin * shift(-part.ref * part.axis));
      const std::string child = is_last ? own.name : links_.unused(part.name);
      if (!is_last) {
        add_link(child, {}, own.gravity, part.place);
        if (part.type != JointType::ball || part.part() == 2)
          report().remark("links without mass between the joints of one body", child);
      }
      add_joint(part, parent, child, origin);
      origin = Isometry3d::Identity();
      parent = child;
    }
    add_link(own.name, transformed(own.inertia, shift(-anchor)), own.gravity, own.place);
    places_[b] = {own.name, shift(-anchor)};
    if (!own.joints.empty()) return;
    Joint joint;
    joint.name = joints_.unused(own.name);
    joint.parent = parent, joint.child = own.name;
    joint.origin = origin;
    draft_.places["joint '" + joint.name + "'"] = own.place;
    draft_.model.joints.push_back(joint);
  }

  void add_joint(const JointPart& part, const std::string& parent, const std::string& child, const Isometry3d& origin) {
    Joint joint;
    joint.name = part.name;
    joint.parent = parent, joint.child = child;
    joint.origin = origin;
    joint.axis = part.axis;
    joint.kind = part.type == JointType::slide  ? JointKind::prismatic
                 : part.type == JointType::ball ? JointKind::ball
                 : part.lower > -infinity       ? JointKind::revolute
                                                : JointKind::continuous;
    joint.lower = part.lower, joint.upper = part.upper;
    joint.damping = part.damping, joint.armature = part.armature, joint.friction = part.friction;
    joint.stiffness = part.stiffness, joint.rest = part.rest;
    joint.effort_limit = part.effort_limit;
    const bool is_of_ball = !part.ball.empty();
    const auto index = static_cast<std::size_t>(scene_.joint_of.at(is_of_ball ? part.ball : part.name) +
                                                (is_of_ball ? part.part() : 0));
    joint.position = start_.position[index], joint.velocity = start_.velocity[index];
    draft_.places["joint '" + joint.name + "'"] = part.place;
    draft_.model.joints.push_back(joint);
  }

  void add_sites(std::size_t b) {
    const Place& place = places_[b];
    for (const SitePart& part : body(b).sites) {
      if (part.name.empty())
        report().not_used("site without a name");
      else if (place.link.empty())
        report().remark("sites in the world, left out", part.name);
      else {
        draft_.model.sites.push_back({part.name, place.link, place.pose * part.pose});
        draft_.places["site '" + part.name + "'"] = part.place;
      }
    }
  }

  const Scene& scene_;
  const Start& start_;
  Draft& draft_;
  std::vector<Place> places_;
  Names links_, joints_;
  bool has_world_ = false;
};

}  // namespace

std::vector<Place> grow_trees(const Scene& scene, const Start& start, Draft& draft) {
  draft.model.gravity = scene.settings.gravity;
  return Grower(scene, start, draft).grow();
}

}  // namespace lockstep::importer::mjcf
