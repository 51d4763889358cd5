// Tendons over several joints become joints of the kind tendon. SPDX-License-Identifier: Apache-2.0
#include "transmissions.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "lockstep/error.h"
#include "model/by_name.h"
#include "model/loops.h"
#include "model/tendons.h"
#include "names.h"

namespace lockstep::importer::mjcf {
namespace {

constexpr double least_share = 1e-6;  // of a tendon's largest coefficient

class Finder {
 public:
  Finder(const Scene& scene, const Ties& ties, const Ends& ends, Draft& draft)
      : scene_(scene), ties_(ties), ends_(ends), draft_(draft) {
    for (const Joint& joint : draft.model.joints) names_.take(joint.name);
  }

  std::optional<Transmission> transmission(std::size_t index) {
    const Tendon& tendon = scene_.tendons[index];
    if (tendon.is_spatial) return spatial(index);
    if (!tendon.is_whole) return std::nullopt;
    const Form free = ties_.reduced(tendon.length);
    if (free.terms.empty()) return std::nullopt;
    if (free.terms.size() == 1) {
      const auto& [joint, factor] = free.terms.front();
      return Transmission{scene_.joint(joint).name, factor, free.constant};
    }
    if (!has_more_than_a_spring(index)) return std::nullopt;
    if (tendon.armature != 0.0 && !is_on_one_branch(tendon.length))
      scene_.report().remark("armature of tendons across branches, which MuJoCo keeps on each branch alone",
                             title_of(tendon));
    return Transmission{add(tendon)};
  }

  // A soft range is the spring's, on a joint of its own beside the tendon's range.
  void slacken(const Tendon& tendon, const std::optional<Transmission>& transmission) {
    if (!transmission || !tendon.has_slack()) return;
    const bool is_apart = tendon.range || joint_of(transmission->joint).kind != JointKind::tendon;
    Joint& joint = joint_of(!is_apart           ? transmission->joint
                            : tendon.is_spatial ? add_again(transmission->joint)
                                                : add(tendon));
    joint.lower = tendon.shortest, joint.upper = tendon.longest;
    joint.limit_softness = Spring{tendon.stiffness, 0.0};
    scene_.report().remark("springs of tendons with a range without force, as soft limits of tendons", joint.name);
  }

 private:
  // A joint of its own, whose position is the length.
  std::optional<Transmission> spatial(std::size_t index) {
    const Tendon& tendon = scene_.tendons[index];
    if (!has_more_than_a_spring(index) && tendon.stiffness == 0.0 && tendon.damping == 0.0) return std::nullopt;
    if (!tendon.wrapped.empty())
      throw ImportError(tendon.place, "wraps around " + tendon.wrapped + ", which lockstep lacks",
                        "lead it over sites alone, or remove its range, springs, friction and actuators");
    const Trees trees(draft_.model);
    Joint joint, drawn;  // the latter where the file draws mocap bodies, whatever the keyframe says
    joint.kind = drawn.kind = JointKind::tendon;
    bool moves = false;
    for (const Strand& strand : tendon.strands) {
      const auto site = [&](const std::string& name) {
        const End* const found = ends_.find_site(name);
        if (!found)
          throw ImportError(tendon.place, fmt::format("names site '{}', which does not exist", name),
                            "correct the name");
        return *found;
      };
      const End first = site(strand.first), second = site(strand.second);
      if (ends_.is_left_out(first.body) || ends_.is_left_out(second.body)) {
        scene_.report().warn("tendons over bodies left out, left out", title_of(tendon));
        return std::nullopt;
      }
      const Place one = ends_.place_of(first), other = ends_.place_of(second);
      moves |= can_move(draft_.model, trees, one.link, other.link);
      joint.path.push_back({one.link, other.link, one.pose.translation(), other.pose.translation(), strand.share});
      drawn.path.push_back({one.link, other.link, drawn_point(first, one), drawn_point(second, other), strand.share});
    }
    if (!moves) return std::nullopt;
    if (is_driven(index)) warn_of_limits(tendon);
    joint.name = names_.unused(tendon.name.empty() ? "tendon" : tendon.name);
    draft_.places["joint '" + joint.name + "'"] = tendon.place;
    if (tendon.armature != 0.0)
      scene_.report().warn("armature of spatial tendons, left out",
                           fmt::format("{:g} of {}", tendon.armature, joint.name));
    scene_.report().remark("tendons as joints of their own, whose position is the tendon's length", joint.name);
    const double rest = length_of(draft_.model, trees, at_rest(trees), drawn);
    draft_.model.joints.push_back(joint);
    return Transmission{joint.name, 1.0, 0.0, rest};
  }

  // In the frame of the place.
  Eigen::Vector3d drawn_point(const End& end, const Place& place) const {
    const Body& body = scene_.bodies.all[end.body];
    return body.is_mocap ? Eigen::Vector3d((body.in_world * end.frame).translation()) : place.pose.translation();
  }

  void warn_of_limits(const Tendon& tendon) const {
    const auto body_of = [&](const std::string& site) { return static_cast<int>(ends_.find_site(site)->body); };
    for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
      const JointPart& joint = scene_.joint(static_cast<int>(j));
      const auto lengthens = [&](const Strand& strand) {
        const int body = scene_.joints[j].body;
        return scene_.bodies.is_above(body, body_of(strand.first)) !=
               scene_.bodies.is_above(body, body_of(strand.second));
      };
      if (joint.effort_limit < infinity && std::any_of(tendon.strands.begin(), tendon.strands.end(), lengthens))
        scene_.report().warn(limits_of_tendons_joints, joint.name);
    }
  }

  // Joints where their springs are at rest, and what floats where it is drawn, whatever the keyframe says.
  Configuration at_rest(const Trees& trees) const {
    Configuration at = start_of(draft_.model, trees);
    const ByName joints(draft_.model.joints), links(draft_.model.links);
    for (std::size_t j = 0; j < scene_.joints.size(); ++j)
      if (const int own = joints.find(scene_.joint(static_cast<int>(j)).name); own >= 0)
        at.position[static_cast<std::size_t>(own)] = scene_.joint(static_cast<int>(j)).rest;
    for (const Body& body : scene_.bodies.all)
      if (const int link = body.floats() ? links.find(body.name) : -1; link >= 0)
        at.root[static_cast<std::size_t>(trees.tree_of[link])] = body.in_world;
    return at;
  }

  bool is_on_one_branch(const Form& length) const {
    const auto body_of = [&](const auto& term) { return scene_.joints[static_cast<std::size_t>(term.first)].body; };
    for (const auto& one : length.terms)
      for (const auto& other : length.terms)
        if (!scene_.bodies.is_above(body_of(one), body_of(other)) &&
            !scene_.bodies.is_above(body_of(other), body_of(one)))
          return false;
    return true;
  }

  bool has_more_than_a_spring(std::size_t index) const {
    const Tendon& tendon = scene_.tendons[index];
    return tendon.range || tendon.has_slack() || tendon.friction != 0.0 || tendon.armature != 0.0 || is_driven(index);
  }
  bool is_driven(std::size_t index) const {
    return std::any_of(scene_.actuators.begin(), scene_.actuators.end(), [&](const Actuator& actuator) {
      return scene_.settings.has_actuation && actuator.lost.empty() && actuator.tendon == static_cast<int>(index);
    });
  }

  Joint& joint_of(const std::string& name) {
    Model& model = draft_.model;
    return model.joints[static_cast<std::size_t>(model.joint_index(name))];
  }

  // Another joint with the path of this one, and nothing else of it.
  std::string add_again(const std::string& name) {
    const Joint& own = joint_of(name);
    Joint joint;
    joint.name = names_.unused(name), joint.kind = JointKind::tendon;
    joint.path = own.path;
    draft_.places["joint '" + joint.name + "'"] = draft_.places["joint '" + name + "'"];
    draft_.model.joints.push_back(joint);
    return joint.name;
  }

  // Its position is the tendon's length. Joints that stand still are constants.
  std::string add(const Tendon& tendon) {
    Joint joint;
    joint.name = names_.unused(tendon.name.empty() ? "tendon" : tendon.name);
    joint.kind = JointKind::tendon;
    Coupling coupling{joint.name, {}, 0.0, Hard{}};
    double largest = 0.0;
    for (const auto& term : tendon.length.terms) largest = std::max(largest, std::abs(term.second));
    for (const auto& term : tendon.length.terms) {
      if (std::abs(term.second) < least_share * largest && term.second != 0.0)
        scene_.report().warn("joints that move a tendon by less than a millionth of what others do, left out",
                             fmt::format("{} of {}", scene_.joint(term.first).name, title_of(tendon)));
      if (std::abs(term.second) <= least_share * largest) continue;
      const Form alone = ties_.reduced({{term}, 0.0});
      if (alone.terms.empty())
        coupling.offset -= alone.constant;
      else
        coupling.terms.push_back({scene_.joint(term.first).name, -term.second});
    }
    draft_.places["joint '" + joint.name + "'"] = draft_.places["coupling '" + joint.name + "'"] = tendon.place;
    scene_.report().remark("tendons as joints of their own, whose position is the tendon's length", joint.name);
    draft_.model.joints.push_back(joint);
    draft_.model.couplings.push_back(coupling);
    return joint.name;
  }

  const Scene& scene_;
  const Ties& ties_;
  const Ends& ends_;
  Draft& draft_;
  Names names_;
};

}  // namespace

std::vector<std::optional<Transmission>> transmissions_of_tendons(const Scene& scene, const Ties& ties,
                                                                  const Ends& ends, Draft& draft) {
  if (scene.tendons.empty()) return {};
  Finder finder(scene, ties, ends, draft);
  std::vector<std::optional<Transmission>> transmissions(scene.tendons.size());
  for (std::size_t t = 0; t < scene.tendons.size(); ++t)
    scene.report().attempt([&] { transmissions[t] = finder.transmission(t); });
  for (std::size_t t = 0; t < transmissions.size(); ++t) finder.slacken(scene.tendons[t], transmissions[t]);
  place_tendons(draft.model);
  return transmissions;
}

std::string title_of(const Tendon& tendon) { return tendon.name.empty() ? tendon.place : tendon.name; }

}  // namespace lockstep::importer::mjcf
