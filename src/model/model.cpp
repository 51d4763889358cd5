// Look-ups in a Model, and small functions that make parts of it. SPDX-License-Identifier: Apache-2.0
#include "lockstep/model.h"

#include <algorithm>
#include <map>

#include "by_name.h"
#include "lockstep/error.h"
#include "trees.h"

namespace lockstep {
namespace {

template <class Elements>
int index_of(const Elements& elements, const std::string& name, const char* kind, const Model& model) {
  for (std::size_t i = 0; i < elements.size(); ++i)
    if (elements[i].name == name) return static_cast<int>(i);
  throw ModelError(std::string(kind) + " '" + name + "'",
                   std::string("no such ") + kind + " in model '" + model.name + "'", "check the spelling");
}

}  // namespace

Inertia Inertia::box(double mass, const Eigen::Vector3d& size, const Eigen::Vector3d& center) {
  const Eigen::Vector3d squares = size.cwiseProduct(size);
  const Eigen::Vector3d diagonal = mass / 12.0 * (Eigen::Vector3d::Constant(squares.sum()) - squares);
  return {mass, center, diagonal.asDiagonal()};
}

int Model::link_index(const std::string& link) const { return index_of(links, link, "link", *this); }
int Model::joint_index(const std::string& joint) const { return index_of(joints, joint, "joint", *this); }
int Model::site_index(const std::string& site) const { return index_of(sites, site, "site", *this); }

Site& Model::add_site(const std::string& site, const std::string& link, const Pose& pose) {
  link_index(link);
  const bool taken = std::any_of(sites.begin(), sites.end(), [&](const Site& s) { return s.name == site; });
  if (site.empty() || taken)
    throw ModelError("site '" + site + "'", site.empty() ? "has no name" : "is there already", "give it its own name");
  return sites.emplace_back(Site{site, link, pose});
}

int Model::add_ball(const std::string& given, const std::string& parent, const std::string& child, const Pose& origin) {
  const std::string name = given, last = child;  // these may be names of elements, which move as the lists grow
  std::string carrier = parent;
  for (const char part : {'x', 'y', 'z'}) {
    const std::string own = name + "." + part;
    const auto is_own = [&](const auto& element) { return element.name == own; };
    if (name.empty() || std::any_of(joints.begin(), joints.end(), is_own) ||
        std::any_of(links.begin(), links.end(), is_own))
      throw ModelError("ball joint '" + name + "'",
                       name.empty() ? "has no name" : "needs the name '" + own + "', which is taken",
                       "give it its own name");
  }
  const auto first = static_cast<int>(joints.size());
  const Pose place = origin;
  for (int part = 0; part < 3; ++part) {
    Joint joint;
    joint.name = name + "." + "xyz"[part];
    joint.kind = JointKind::ball;
    joint.parent = carrier, joint.child = carrier = part == 2 ? last : joint.name;
    if (part == 0) joint.origin = place;
    joint.axis = Eigen::Vector3d::Unit(part);
    if (part < 2) links.push_back({joint.name, {}});
    joints.push_back(std::move(joint));
  }
  return first;
}

std::vector<std::string> Model::end_colliders() const {
  const Trees trees(*this);
  std::vector<bool> carries(links.size());  // by carrier: another moving body
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (joints[j].moves() && trees.joint_parent[j] >= 0) carries[trees.carrier[trees.joint_parent[j]]] = true;
  std::vector<std::string> names;
  const ByName by_name(links);
  for (const Collider& collider : colliders) {
    if (collider.link.empty()) continue;
    int link = by_name.find(collider.link);
    if (link < 0) link = link_index(collider.link);  // which throws
    if (!trees.is_bolted(link) && !carries[trees.carrier[link]]) names.push_back(collider.name);
  }
  return names;
}

std::vector<std::string> coupling_names(const Model& model) {
  std::vector<std::string> names;
  std::map<std::string, int> seen;
  for (const Coupling& coupling : model.couplings)
    names.push_back(coupling_name(coupling.joint, ++seen[coupling.joint]));
  return names;
}

}  // namespace lockstep
