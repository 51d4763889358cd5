// Pairs of geoms by MuJoCo's rules. SPDX-License-Identifier: Apache-2.0
#include "colliders.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

#include "contact_softness.h"
#include "model/by_name.h"
#include "model/contact_pairs.h"
#include "model/softness_numbers.h"
#include "model/trees.h"
#include "names.h"
#include "standing.h"
#include "start_inertia.h"

namespace lockstep::importer::mjcf {
namespace {

constexpr std::size_t most_contacts = 200000;

struct Friction {
  double sliding, torsional, rolling;  // the latter two in m
};

// How a geom touches.
struct Touch {
  std::size_t body = 0;
  int carrier = -1;  // the link that carries its body in the model, where equalities may hold joints; -1 in the world
  std::size_t collider = 0;  // its number
  std::string geom = {};     // its name
  int type = 0, affinity = 0, dimension = 3;
  Friction friction = {1.0, 0.005, 0.0001};
  GeomYielding yielding = {};
};

// What holds for all points of a pair.
struct Law {
  Friction friction;
  int dimension;
  Yielding yielding;
  double margin;
};

const char* name_of(GeomType type) {
  constexpr const char* names[] = {"plane",    "hfield", "sphere", "capsule", "ellipsoid",
                                   "cylinder", "box",    "mesh",   "sdf"};
  return names[static_cast<std::size_t>(type)];
}

// How many components its force has.
int dimension_of(const Element& element) {
  const int dimension = element.whole("condim", 3);
  if (dimension != 1 && dimension != 3 && dimension != 4 && dimension != 6)
    element.fail(fmt::format("has a condim of {}", dimension), "give 1, 3, 4 or 6");
  return dimension;
}

class Collision {
 public:
  Collision(const Scene& scene, const std::vector<Place>& places, Draft& draft)
      : scene_(scene), places_(places), model_(draft.model), draft_(draft), trees_(draft.model), links_(model_.links) {}

  void collide() {
    names_.take("robot");  // the group
    read_section();
    for (std::size_t b = 0; b < scene_.bodies.all.size(); ++b)
      if (b == 0 || scene_.is_read[b])
        for (const GeomPart& geom : scene_.bodies.all[b].geoms) add_geom(b, geom);
    find_welds();
    soften_colliders();
    for (const Element::Xml* xml : pairs_) add_pair(scene_.classes.element(*xml, ""));
    add_all_by_masks();
    if (own_pairs_ > 0)
      report().remark("pairs of a robot with itself, left out on request", std::to_string(own_pairs_));
  }

 private:
  Report& report() const { return scene_.report(); }

  void read_section() {
    for (const Element::Xml* xml : scene_.section("contact")) {
      const std::string_view tag = xml->Name();
      if (tag == "pair") {
        const Element pair = scene_.classes.element(*xml, "");
        for (const char* geom : {"geom1", "geom2"}) paired_.insert(pair.name(geom));
        pairs_.push_back(xml);
      } else if (tag == "exclude") {
        const Element exclude(scene_.document, *xml);
        excluded_.insert(std::minmax({exclude.name("body1"), exclude.name("body2")}));
      }
    }
  }

  void add_geom(std::size_t b, const GeomPart& geom) {
    const Element& element = geom.element;
    const int type = element.whole("contype", 1), affinity = element.whole("conaffinity", 1);
    if (type == 0 && affinity == 0 && !paired_.contains(geom.name)) return;
    const Body& body = scene_.bodies.all[b];
    const std::string& item = geom.name.empty() ? body.name : geom.name;
    if (!geom.mesh.empty() && geom.type != GeomType::sdf) {
      if (scene_.options.leave_out_meshes)
        return report().warn("geoms with meshes, left out of the colliders on request", item);
      if (const std::string reason = scene_.meshes.unreadable(geom); !reason.empty())
        return report().warn("geoms with meshes, left out of the colliders",
                             fmt::format("that of {} {}", item, reason));
    }
    const std::optional<PlacedShape> placed = scene_.meshes.shape_of(geom, body.name, item);
    if (!placed && !geom.mesh.empty() && geom.type != GeomType::sdf)
      return report().remark("geoms with meshes that touch nothing: of fit none", item);
    if (!placed)
      return report().warn("geoms of types that no collider has, left out of the colliders",
                           fmt::format("{} of {}", name_of(geom.type), item));
    double friction[3] = {1.0, 0.005, 0.0001};
    element.numbers("friction", friction, 1, 3);
    friction[0] = held_friction(friction[0], item);
    const std::string name = names_.unused(geom.name.empty() ? body.name : geom.name);
    const std::string& link = places_[b].link;
    const int carrier = link.empty() ? -1 : trees_.carrier[static_cast<std::size_t>(links_.find(link))];
    const int dimension = dimension_of(element);
    touches_.push_back({b,
                        carrier,
                        touches_.size(),
                        geom.name,
                        type,
                        affinity,
                        dimension,
                        {friction[0], friction[1], friction[2]},
                        geom_yielding_of(element)});
    touch_of_.emplace(geom.name, touches_.size() - 1);
    model_.colliders.push_back({.name = name,
                                .link = places_[b].link,
                                .shape = placed->shape,
                                .pose = places_[b].pose * placed->pose,
                                .friction = friction[0],
                                .group = b == 0 || body.is_mocap ? "" : "robot",
                                .torsional_friction = dimension > 3 && friction[0] > 0.0 ? friction[1] : 0.0,
                                .rolling_friction = dimension > 4 && friction[0] > 0.0 ? friction[2] : 0.0});
    draft_.places["collider '" + name + "'"] = geom.place;
    for (const char* number : {"margin", "gap"})
      if (element.number(number, 0.0) != 0.0) report().warn("margins and gaps of contacts, left out", name);
  }

  // By body: the body that carries all that is fixed to it, the one that carries that, and the one that the world does.
  void find_welds() {
    for (std::size_t b = 0; b < scene_.bodies.all.size(); ++b) {
      const Body& body = scene_.bodies.all[b];
      const auto parent = static_cast<std::size_t>(std::max(0, body.parent));
      weld_.push_back(b > 0 && body.joints.empty() ? weld_[parent] : b);
      top_.push_back(body.parent > 0 ? top_[parent] : b);
      weld_parent_.push_back(b == 0 ? 0 : body.joints.empty() ? weld_parent_[parent] : weld_[parent]);
    }
  }

  bool stands(const Touch& touch) const { return touch.carrier < 0 || trees_.is_bolted(touch.carrier); }

  bool can_touch(const Touch& a, const Touch& b) const {
    return weld_[a.body] != weld_[b.body] && a.carrier != b.carrier && !(stands(a) && stands(b));
  }

  static bool masks_meet(int type, int affinity, int other_type, int other_affinity) {
    return (type & other_affinity) || (other_type & affinity);
  }

  // In blocks of equal masks that move as one, so that time is that of the pairs that are found: nothing within a block
  // touches, and blocks whose masks do not meet are passed over.
  void add_all_by_masks() {
    std::map<std::pair<int, int>, std::map<int, std::vector<std::size_t>>> blocks;  // by masks and carrier, in order
    const auto carrier_of = [&](const Touch& touch) { return stands(touch) ? -1 : touch.carrier; };
    for (std::size_t i = 0; i < touches_.size(); ++i)
      blocks[{touches_[i].type, touches_[i].affinity}][carrier_of(touches_[i])].push_back(i);
    std::vector<std::size_t> others;
    for (std::size_t i = 0; i < touches_.size(); ++i) {
      const Touch& touch = touches_[i];
      others.clear();
      for (const auto& [masks, carriers] : blocks) {
        if (!masks_meet(touch.type, touch.affinity, masks.first, masks.second)) continue;
        for (const auto& [carrier, block] : carriers)
          if (carrier != carrier_of(touch))
            others.insert(others.end(), std::upper_bound(block.begin(), block.end(), i), block.end());
      }
      std::sort(others.begin(), others.end());
      for (const std::size_t other : others) add_by_masks(touch, touches_[other]);
    }
  }

  void add_by_masks(const Touch& a, const Touch& b) {
    if (!can_touch(a, b)) return;
    const std::size_t one = weld_[a.body], other = weld_[b.body];
    const bool are_joined = one != 0 && other != 0 && (weld_parent_[a.body] == other || weld_parent_[b.body] == one);
    if (are_joined && scene_.settings.filters_parents) return;
    if (excluded_.contains(std::minmax({scene_.bodies.all[a.body].name, scene_.bodies.all[b.body].name}))) return;
    if (!scene_.options.self_collisions && top_[a.body] == top_[b.body]) {
      ++own_pairs_;
      return;
    }
    add(a, b, combined(a, b));
  }

  // Also of a geom with one of MuJoCo's own numbers in the world, which a caller's ground is.
  static Law combined(const Touch& a, const Touch& b) {
    const int first = a.yielding.priority, second = b.yielding.priority;
    const auto larger = [&](double Friction::*number) { return std::max(a.friction.*number, b.friction.*number); };
    Law law{{larger(&Friction::sliding), larger(&Friction::torsional), larger(&Friction::rolling)},
            std::max(a.dimension, b.dimension),
            mixed(a.yielding, b.yielding),
            a.yielding.margin + b.yielding.margin};
    if (first != second) {
      const Touch& ruling = first > second ? a : b;
      law.friction = ruling.friction, law.dimension = ruling.dimension;
    }
    return law;
  }

  static std::string pair_name_of(const Element& element) {
    return fmt::format("{} of {} and {}", element.name("name", element.place()), element.name("geom1"),
                       element.name("geom2"));
  }

  void add_pair(const Element& element) {
    const auto first = touch_of_.find(element.name("geom1")), second = touch_of_.find(element.name("geom2"));
    if (first == touch_of_.end() || second == touch_of_.end())
      return report().warn("contact pairs of geoms that are no colliders, left out", element.place());
    const Touch &a = touches_[first->second], &b = touches_[second->second];
    if (!can_touch(a, b))
      return report().warn("contact pairs that cannot move against each other, left out", element.place());
    double friction[5] = {1.0, 1.0, 0.005, 0.0001, 0.0001};
    element.numbers("friction", friction, 1, 5);
    friction[0] = held_friction(friction[0], pair_name_of(element)), friction[1] = std::min(friction[1], most_friction);
    const int dimension = dimension_of(element);
    if (dimension > 1 && friction[0] != friction[1])
      report().warn("contact pairs whose two tangential frictions differ, taken as the first",
                    fmt::format("{} has {:g} and {:g}", pair_name_of(element), friction[0], friction[1]));
    if (dimension > 4 && friction[3] != friction[4])
      report().warn("contact pairs whose two rolling frictions differ, taken as the first",
                    fmt::format("{} has {:g} and {:g}", pair_name_of(element), friction[3], friction[4]));
    add(a, b,
        {{friction[0], friction[2], friction[3]},
         dimension,
         yielding_of(element, "solref", "solimp"),
         std::max(0.0, element.number("margin", 0.0) - element.number("gap", 0.0))});
  }

  double held_friction(double friction, const std::string& item) const {
    if (friction > most_friction) report().warn("frictions above 100, taken as 100", item);
    return std::min(friction, most_friction);
  }

  void add(const Touch& a, const Touch& b, Law law) {
    if (const auto& all = scene_.settings.all_contacts)
      law = {{std::min(all->friction[0], most_friction), all->friction[2], all->friction[3]},
             law.dimension,
             all->yielding,
             all->margin};
    if (!seen_.insert(std::minmax({a.collider, b.collider})).second) return;
    if (seen_.size() > most_contacts)
      scene_.bodies.all[a.body].geoms.front().element.fail(
          fmt::format("belongs to more than {} pairs that may touch", most_contacts), "give contype and conaffinity");
    const Collider &one = model_.colliders[a.collider], &other = model_.colliders[b.collider];
    Contact contact{
        .first = one.name, .second = other.name, .friction = law.dimension == 1 ? 0.0 : law.friction.sliding};
    const bool slides = *contact.friction > 0.0;
    const double torsional = slides && law.dimension > 3 ? law.friction.torsional : 0.0,
                 rolling = slides && law.dimension > 4 ? law.friction.rolling : 0.0;
    if (torsional > 0.0 || one.torsional_friction > 0.0 || other.torsional_friction > 0.0)
      contact.torsional_friction = torsional;
    if (rolling > 0.0 || one.rolling_friction > 0.0 || other.rolling_friction > 0.0) contact.rolling_friction = rolling;
    const Softness softness = softness_between(a, b, law);
    if (!is_hard(softness))
      report().tally("contacts soft as in MuJoCo, without its virtual mass", words_of(law.yielding));
    if (!is_hard(softness) || !is_hard(one.softness) || !is_hard(other.softness)) contact.softness = softness;
    model_.contacts.push_back(contact);
  }

  // What is found once something is soft.
  struct Rest {
    SolverSettings solver;
    std::vector<double> responses;  // by body
    std::vector<double> loads;      // by collider
  };

  Softness softness_between(const Touch& a, const Touch& b, const Law& law) {
    if (is_default(law.yielding)) return Hard{};
    if (!rest_)
      rest_ = {read_solver(scene_.document, scene_.settings), body_responses(scene_), loads_at_rest(model_, trees_)};
    return softness_of(law.yielding,
                       {rest_->responses[a.body] + rest_->responses[b.body], law.friction.sliding, law.dimension,
                        law.margin, std::min(rest_->loads[a.collider], rest_->loads[b.collider])},
                       rest_->solver);
  }

  // By what they are against a geom of MuJoCo's own numbers in the world, such as a ground that is added later.
  void soften_colliders() {
    for (const Touch& touch : touches_) {
      const Touch ground{.collider = touch.collider};
      Collider& collider = model_.colliders[touch.collider];
      if (scene_.bodies.moves[touch.body]) collider.softness = softness_between(touch, ground, combined(touch, ground));
      if (const auto* spring = std::get_if<Spring>(&collider.softness))
        report().remark("geoms whose contacts are soft",
                        fmt::format("{} by {:.3g} N/m and {:.3g} N s/m", collider.name, spring->kp, spring->kd));
      else
        report().tally("contacts take lockstep's own softness, in MuJoCo", words_of(touch.yielding.yielding));
    }
  }

  const Scene& scene_;
  const std::vector<Place>& places_;
  Model& model_;
  Draft& draft_;
  const Trees trees_;
  const ByName links_;
  std::vector<Touch> touches_;
  std::unordered_map<std::string, std::size_t> touch_of_;  // by the geom's name
  std::vector<const Element::Xml*> pairs_;
  std::unordered_set<std::string> paired_;
  std::set<std::pair<std::string, std::string>> excluded_;
  std::set<std::pair<std::size_t, std::size_t>> seen_;  // colliders
  Names names_;
  std::vector<std::size_t> weld_, weld_parent_, top_;
  int own_pairs_ = 0;
  std::optional<Rest> rest_;
};

}  // namespace

void collide(const Scene& scene, const std::vector<Place>& places, Draft& draft) {
  if (scene.settings.has_contacts) Collision(scene, places, draft).collide();
}

void list_contacts(Document& document) {
  document.section("contact");  // visits it, so that pairs and excludes are counted
}

}  // namespace lockstep::importer::mjcf
