// Which colliders may touch: the rules for colliders, groups as pairs. SPDX-License-Identifier: Apache-2.0
#include "contact_pairs.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "by_name.h"
#include "hull.h"
#include "joint_motion.h"
#include "lockstep/error.h"
#include "rules.h"
#include "shapes.h"

namespace lockstep {
namespace {

using std::string;

void proper_friction(double friction, const string& element) {
  not_negative(friction, element, "friction");
  require(friction <= most_friction, element, "has a friction above 100",
          "give 1 to 3, which holds whatever is not nearly upright");
}

void proper_turning_friction(double torsional, double rolling, const string& element) {
  not_negative(torsional, element, "torsional friction");
  not_negative(rolling, element, "rolling friction");
}

void proper_restitution(double restitution, const string& element) {
  require(restitution >= 0.0 && restitution <= 1.0, element,
          "restitution is " + std::to_string(restitution) + ", outside [0, 1]", "give a share between 0 and 1");
}

void proper_contact_softness(const Softness& softness, const string& element) {
  proper_softness(softness, element, "contact");
  require(!is_absent(softness), element, "softness of the contact has neither stiffness nor damping",
          "give it stiffness or damping, or leave the contact out");
  require(!is_hard(softness) || erp_of(softness) <= 1.0, element,
          "erp of a hard contact is " + std::to_string(erp_of(softness)) + ", above 1", "give 0.2");
}

void proper_points(const Eigen::Matrix3Xd& points, const string& element) {
  try {
    const Eigen::Index corners = hull_of(points).corners.cols();
    require(
        corners <= most_hull_corners, element,
        string("has a hull of ") + std::to_string(corners) + " corners, more than " + std::to_string(most_hull_corners),
        "leave out points that matter least");
  } catch (const std::invalid_argument& problem) {
    throw ModelError(element, problem.what(), "give points of a solid; make a flat one a thin box");
  }
}

void proper_heights(const Shape& shape, const string& element) {
  const Eigen::MatrixXd& heights = shape.heights;
  require(heights.rows() >= 2 && heights.cols() >= 2 && heights.size() <= most_heights, element,
          "has " + std::to_string(heights.rows()) + " x " + std::to_string(heights.cols()) + " heights",
          "give 2 x 2 to " + std::to_string(most_heights) + " of them");
  require(heights.allFinite() && heights.cwiseAbs().maxCoeff() <= most_height, element,
          "has a height that is not finite or beyond " + std::to_string(most_height) + " m", "give heights in m");
}

void proper_shape(const Shape& shape, const string& element) {
  require(std::find(std::begin(all_shape_kinds), std::end(all_shape_kinds), shape.kind) != std::end(all_shape_kinds),
          element, "has a shape that is none of the enumerators", "give one of ShapeKind");
  const int numbers = rule_of(shape.kind).sizes;
  for (int k = 0; k < 3; ++k) {
    const double size = shape.size[k];
    require(k < numbers || size == 0.0, element, "has a size that its kind of shape does not have",
            "set it to 0; make shapes by Shape::box() and its like");
    const bool fits = shape.kind == ShapeKind::hull ? size >= 0.0 : size > 0.0;
    require(k >= numbers || (std::isfinite(size) && fits), element,
            "has a size of " + std::to_string(size) + " m, which is not above 0", "give its edges, radius and length");
  }
  require(shape.kind == ShapeKind::hull || shape.points.cols() == 0, element,
          "has points, and its kind of shape has none", "make shapes by Shape::box() and its like");
  require(shape.kind == ShapeKind::height_field || shape.heights.size() == 0, element,
          "has heights, and its kind of shape has none", "make shapes by Shape::box() and its like");
  if (shape.kind == ShapeKind::height_field) proper_heights(shape, element);
  if (shape.kind == ShapeKind::hull) proper_points(shape.points, element);
}

class Resolver {
 public:
  Resolver(const Model& model, const Trees& trees) : model_(model), trees_(trees), colliders_(model.colliders) {
    for (std::size_t i = 0; i < model.colliders.size(); ++i)
      if (const string& group = model.colliders[i].group; !group.empty()) groups_[group].push_back(static_cast<int>(i));
  }

  ContactPairs resolve() {
    proper_colliders();
    for (const Contact& contact : model_.contacts) add(contact);
    return std::move(found_);
  }

 private:
  void proper_colliders() {
    unique_names(model_.colliders, "collider");
    const ByName links(model_.links);
    for (const Collider& collider : model_.colliders) {
      const string element = quoted("collider", collider.name);
      int link = collider.link.empty() ? -1 : links.find(collider.link);
      if (link < 0 && !collider.link.empty()) link = model_.link_index(collider.link);  // which throws
      rigid(collider.pose, element, "pose");
      proper_shape(collider.shape, element);
      proper_friction(collider.friction, element);
      proper_turning_friction(collider.torsional_friction, collider.rolling_friction, element);
      proper_restitution(collider.restitution, element);
      proper_contact_softness(collider.softness, element);
      carrier_.push_back(link < 0 ? -1 : trees_.carrier[link]);
      require(!is_ground(collider.shape.kind) || stands_still(carrier_.back()), element,
              string("is a ") + (collider.shape.kind == ShapeKind::half_space ? "half-space" : "height field") +
                  " on a link that moves",
              "put it in the world or on a bolted link, or make it a box");
    }
    for (const Collider& collider : model_.colliders)
      require(colliders_.find(collider.group) < 0, quoted("collider", collider.name),
              "is in group '" + collider.group + "', which is also the name of a collider", "rename one of them");
  }

  std::vector<int> members(const string& name, const string& element) const {
    if (const int collider = colliders_.find(name); collider >= 0) return {collider};
    const auto group = groups_.find(name);
    require(group != groups_.end(), element, "names '" + name + "', which is neither a collider nor a group",
            "correct the name, or give colliders that group");
    return group->second;
  }

  bool stands_still(int carrier) const { return carrier < 0 || trees_.is_bolted(carrier); }

  // A joint connects the links' bodies, in either order.
  bool joined(int a, int b) const {
    const auto carried_by = [&](int child, int parent) {
      int joint = child < 0 ? -1 : trees_.parent_joint[child];
      while (joint >= 0 && is_inner_part(model_.joints[static_cast<std::size_t>(joint)]))
        joint = trees_.parent_joint[trees_.joint_parent[joint]];
      return joint >= 0 && trees_.carrier[trees_.joint_parent[joint]] == parent;
    };
    return carried_by(a, b) || carried_by(b, a);
  }

  // Why two colliders cannot touch whatever they are called; empty if they can.
  string obstacle(int a, int b) const {
    if (a == b) return "they are the same collider";
    if (carrier_[a] == carrier_[b] && carrier_[a] >= 0) return "they are parts of one body";
    if (stands_still(carrier_[a]) && stands_still(carrier_[b])) return "both stand still";
    return "";
  }

  void add(const Contact& contact) {
    const string element = quoted("contact", contact.first + "-" + contact.second);
    if (contact.friction) proper_friction(*contact.friction, element);
    proper_turning_friction(contact.torsional_friction.value_or(0.0), contact.rolling_friction.value_or(0.0), element);
    if (contact.restitution) proper_restitution(*contact.restitution, element);
    if (contact.softness) proper_contact_softness(*contact.softness, element);
    const std::vector<int> firsts = members(contact.first, element), seconds = members(contact.second, element);
    const bool named = colliders_.find(contact.first) >= 0 && colliders_.find(contact.second) >= 0;
    for (const int a : firsts)
      for (const int b : seconds) {
        const string why = obstacle(a, b);
        require(!named || why.empty(), element, "can never be a contact: " + why, "remove it");
        const string names = model_.colliders[a].name + "-" + model_.colliders[b].name;
        if (a == b || (contact.first == contact.second && b < a)) continue;
        if (!why.empty()) {
          found_.left_out.push_back(names + ": " + why);
        } else if (!named && joined(carrier_[a], carrier_[b])) {
          found_.left_out.push_back(names + ": a joint connects their links");
        } else {
          const bool is_new = seen_.insert({std::min(a, b), std::max(a, b)}).second;
          require(is_new || !named, element, "appears twice", "name each pair once");
          if (is_new) add(contact, a, b, element);
        }
      }
  }

  void add(const Contact& contact, int a, int b, const string& element) {
    const Collider &one = model_.colliders[a], &other = model_.colliders[b];
    ColliderPair pair{a, b, other.shape.kind < one.shape.kind, 0.0, 0.0, {}, 0.0, 0.0};
    if (pair.swapped) std::swap(pair.first, pair.second);
    pair.friction = contact.friction.value_or(std::sqrt(one.friction * other.friction));
    pair.restitution = contact.restitution.value_or(std::max(one.restitution, other.restitution));
    const bool own = !same(one.softness, Hard{}), others = !same(other.softness, Hard{});
    require(contact.softness || !own || !others || same(one.softness, other.softness), element,
            "joins colliders '" + one.name + "' and '" + other.name + "', which differ in softness",
            "give the contact a softness of its own");
    pair.softness = contact.softness.value_or(own ? one.softness : other.softness);
    pair.torsional_friction =
        contact.torsional_friction.value_or(std::max(one.torsional_friction, other.torsional_friction));
    pair.rolling_friction = contact.rolling_friction.value_or(std::max(one.rolling_friction, other.rolling_friction));
    require(pair.friction > 0.0 || (pair.torsional_friction == 0.0 && pair.rolling_friction == 0.0), element,
            "resists turning of colliders '" + one.name + "' and '" + other.name + "' without friction between them",
            "give the contact a friction above 0, or a torsional and a rolling friction of 0");
    found_.pairs.push_back(pair);
  }

  static bool same(const Softness& a, const Softness& b) {
    const SoftnessNumbers one = numbers_of(a), other = numbers_of(b);
    return a.index() == b.index() && one.first == other.first && one.second == other.second;
  }

  const Model& model_;
  const Trees& trees_;
  const ByName colliders_;
  std::unordered_map<string, std::vector<int>> groups_;  // colliders
  std::vector<int> carrier_;                             // by collider: the link that carries its body, -1 in the world
  std::set<std::pair<int, int>> seen_;
  ContactPairs found_;
};

}  // namespace

ContactPairs contact_pairs(const Model& model, const Trees& trees) { return Resolver(model, trees).resolve(); }

std::string pair_name(const Model& model, const ColliderPair& pair) {
  const std::string &first = model.colliders[static_cast<std::size_t>(pair.first)].name,
                    &second = model.colliders[static_cast<std::size_t>(pair.second)].name;
  return pair.swapped ? second + "-" + first : first + "-" + second;
}

}  // namespace lockstep
