// The rules for a Model, one function for each. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <unordered_map>

#include "by_name.h"
#include "contact_pairs.h"
#include "functions.h"
#include "inertia.h"
#include "joint_motion.h"
#include "judge.h"
#include "lockstep/error.h"
#include "loops.h"
#include "moved_inertia.h"
#include "poses.h"
#include "rules.h"
#include "tendons.h"
#include "trees.h"

namespace lockstep {
namespace {

using std::string;

// Beyond this gear ratio, rounding in double leaves no digits of the smaller side.
constexpr double largest_ratio = 1e9;

constexpr double largest_mass = 1e100;  // kg: products of two masses are numbers

constexpr int most_delay = 1000;  // steps, each of which moves as many numbers

void proper_numbers(const Link& link) {
  const string element = quoted("link", link.name);
  not_negative(link.inertia.mass, element, "mass");
  require(link.inertia.mass <= largest_mass, element, "mass is beyond 1e100 kg, so that its products overflow",
          "give it in kg");
  finite(link.inertia.center, element, "centre of mass");
  finite(link.inertia.about_center, element, "inertia");
  finite(link.gravity, element, "share of gravity");
}

// "a, b, c", not too long.
string listed(const std::vector<string>& names) {
  constexpr std::size_t most = 30;
  string text;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) text += (i > 0 ? ", " : "") + names[i];
  return names.size() > most ? text + ", ... " + std::to_string(names.size() - most) + " more" : text;
}

// The first of a body's links whose own tensor is impossible.
const Link& impossible_link(const Model& model, const Trees& trees, int carrier) {
  for (std::size_t i = 0; i < model.links.size(); ++i)
    if (trees.carrier[i] == carrier && fault_of(model.links[i].inertia) != InertiaFault::none) return model.links[i];
  return model.links[carrier];
}

std::vector<string> names_of(const Model& model, const std::vector<UnmovedLink>& unmoved) {
  std::vector<string> names;
  for (const UnmovedLink& found : unmoved) names.push_back(model.links[found.link].name);
  return names;
}

// A tensor is judged where it moves: as part of the body that its link forms with all links fixed to it. One error
// names all impossible and all missing ones.
void possible_inertias(const Model& model, const Trees& trees, const std::vector<Inertia>& bodies) {
  InertiaFault first = InertiaFault::none;
  std::vector<string> impossible;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    const int carrier = static_cast<int>(i);
    if (trees.carrier[i] != carrier || trees.is_bolted(carrier)) continue;
    const Inertia& body = bodies[i];
    finite(body.mass * body.center.squaredNorm(), quoted("link", model.links[i].name), "inertia");
    finite(body.about_center, quoted("link", model.links[i].name), "inertia");
    const InertiaFault fault = fault_of(body);
    if (fault == InertiaFault::none) continue;
    if (impossible.empty()) first = fault;
    impossible.push_back(impossible_link(model, trees, carrier).name);
  }
  if (impossible.empty()) return;
  const string element = quoted("link", impossible.front());
  impossible.erase(impossible.begin());
  const std::vector<string> missing = names_of(model, unmoved_links(model, trees, bodies));
  const string others = (impossible.empty() ? "" : "; impossible, too: " + listed(impossible)) +
                        (missing.empty() ? "" : "; without mass or inertia to move: " + listed(missing));
  const string repair = "; ImportOptions::repair_inertias takes the nearest possible one";
  require(first != InertiaFault::asymmetric, element, "inertia is not symmetric" + others, "give ixy = iyx and so on");
  require(first != InertiaFault::negative, element, "inertia is impossible: a principal moment is negative" + others,
          "check the signs of the products of inertia" + repair);
  throw ModelError(element,
                   "inertia is impossible: one principal moment exceeds the sum of the others (no distribution of mass "
                   "has that)" +
                       others,
                   "check the units, and that it is about the centre of mass" + repair);
}

void proper_range(const Joint& joint, const string& element) {
  require(!std::isnan(joint.lower) && !std::isnan(joint.upper), element, "position limit is NaN",
          "give a number, or an infinity where there is no limit");
  require(joint.lower <= joint.upper, element, "position range is empty (lower > upper)",
          "swap the limits, or give both, as one that URDF leaves out is 0; or, if the joint should be free, as "
          "PyBullet reads such limits, leave them out: "
          "ImportOptions::ignore");
  require(joint.lower < infinity && joint.upper > -infinity, element, "position range lies at infinity",
          "give lower = -infinity and upper = infinity where there is no limit");
  require(joint.kind != JointKind::continuous || (joint.lower == -infinity && joint.upper == infinity), element,
          "is continuous and yet has a position range", "make it revolute, or remove the range");
}

void proper_bounds(const Joint& joint, const string& element) {
  proper_range(joint, element);
  proper_softness(joint.limit_softness, element, "limit");
  require(!is_absent(joint.limit_softness), element, "softness of the limit has neither stiffness nor damping",
          "give it stiffness or damping, or remove the position range");
  require(joint.restitution >= 0.0 && joint.restitution <= 1.0, element,
          "restitution is " + std::to_string(joint.restitution) + ", outside [0, 1]", "give a share between 0 and 1");
  require(joint.restitution == 0.0 || is_hard(joint.limit_softness), element, "has a restitution, but soft limits",
          "set it to 0, or make the limits hard; how a soft limit bounces depends on its damping");
  require(joint.velocity_limit >= 0.0, element, "velocity limit is negative or NaN",
          "give more than 0, infinity for no limit");
  require(joint.velocity_limit > 0.0, element, "velocity limit is 0, which locks the joint",
          "make the joint fixed or its drive kinematic, or give infinity for no limit");
  require(joint.effort_limit >= 0.0, element, "effort limit is negative or NaN",
          "give 0 or more, infinity for no limit");
  not_negative(joint.friction, element, "friction");
}

// How late a drive is, and how a motor's effort falls with speed.
void proper_actuator(const Joint& joint, const string& element) {
  const Drive& drive = joint.drive;
  require(drive.delay >= 0 && drive.delay <= most_delay, element,
          "delay of the drive is " + std::to_string(drive.delay) + " steps, outside 0 to " + std::to_string(most_delay),
          "give fewer steps of dt");
  not_negative(drive.lag, element, "lag of the drive");
  const bool falls = drive.stall_effort < infinity;
  require(drive.stall_effort > 0.0 && drive.no_load_speed > 0.0 && falls == (drive.no_load_speed < infinity), element,
          "stall effort and no-load speed are " + std::to_string(drive.stall_effort) + " and " +
              std::to_string(drive.no_load_speed),
          "give both, finite and above 0, or leave both infinite");
  require(!falls || !drive.kinematic, element,
          "has a motor's curve, but its drive is kinematic, which no effort bounds",
          "make the drive a servo (kinematic = false), or leave stall_effort and no_load_speed infinite");
  require(!falls || joint.effort_limit < infinity, element, "has a motor's curve, but no effort limit",
          "give Joint::effort_limit, for instance the stall effort");
}

// A setting that this kind of drive would silently ignore is an error.
void proper_drive(const Drive& drive, const string& element) {
  not_negative(drive.kp, element, "drive kp");
  not_negative(drive.kd, element, "drive kd");
  finite(drive.position_target, element, "position target");
  finite(drive.velocity_target, element, "velocity target");
  const Softness& softness = drive.softness;
  if (!drive.kinematic) {
    const auto* hard = std::get_if<Hard>(&softness);
    require(hard && hard->erp == std::get<Hard>(Drive().softness).erp, element,
            "drive has a softness, which only kinematic ones have",
            "make the drive kinematic, or leave its softness as it is and set kp and kd");
    return;
  }
  require(drive.kp == 0.0 && drive.kd == 0.0, element, "kinematic drive has kp or kd",
          "set both to 0 and give Drive::softness, or make the drive a servo (kinematic = false)");
  proper_softness(softness, element, "kinematic drive");
  require(!is_absent(softness), element, "softness of the kinematic drive has neither stiffness nor damping",
          "give it stiffness or damping, or make the drive not kinematic");
  require(!is_hard(softness) || (erp_of(softness) > 0.0 && erp_of(softness) <= 1.0), element,
          "erp of a hard kinematic drive is " + std::to_string(erp_of(softness)) + ", outside (0, 1]",
          "give 1 to reach the target in each step, less to approach it");
}

// A tendon has no place and no inertia of its own.
void proper_tendon(const Joint& joint, const string& element) {
  require(joint.parent.empty() && joint.child.empty(), element, "is a tendon, and yet has a parent or a child link",
          "leave both empty: a tendon connects joints, by the coupling that it follows, or links, by its path");
  const auto by_frequency = [](const Softness& softness) { return std::holds_alternative<Frequency>(softness); };
  require(!by_frequency(joint.limit_softness) && !by_frequency(joint.drive.softness), element,
          "is a tendon, and yet has a softness by frequency, which refers to an inertia of its own",
          "give the softness as a spring");
}

// The three parts of a ball joint follow each other, in the model and in the tree.
void proper_ball(const Model& model, std::size_t j) {
  const Joint& joint = model.joints[j];
  const string element = quoted("joint", joint.name);
  const int part = part_of_ball(joint);
  require(joint.axis == Eigen::Vector3d::Unit(part), element,
          "is a part of a ball joint, and its axis is not x, y or z", "make ball joints by Model::add_ball()");
  const std::size_t first = j - std::min(j, static_cast<std::size_t>(part));
  for (std::size_t k = first; k < first + 3; ++k) {
    const auto expected = static_cast<int>(k - first);
    const bool follows = k < model.joints.size() && model.joints[k].kind == JointKind::ball &&
                         part_of_ball(model.joints[k]) == expected &&
                         (k == first || (model.joints[k].parent == model.joints[k - 1].child &&
                                         model.joints[k].origin.isApprox(Pose::Identity(), 0.0)));
    require(follows, element, "is a part of a ball joint whose parts x, y and z do not follow each other in one place",
            "make ball joints by Model::add_ball()");
  }
  require(!joint.drive.kinematic, element, "is a part of a ball joint, and its drive is kinematic",
          "make the drive a servo (kinematic = false)");
  require(joint.rest == 0.0, element, "is a part of a ball joint, and its spring has a rest position",
          "set it to 0, or use a servo, whose target may be any");
  if (part == 0)
    require(joint.lower == -infinity && joint.upper > 0.0, element, "has a range of angle that does not begin at 0",
            "give lower = -infinity and upper, the largest angle");
  else
    require(joint.lower == -infinity && joint.upper == infinity, element,
            "has a range, which the first part has for all", "give the largest angle as upper of the first part");
  require(!std::holds_alternative<Frequency>(joint.limit_softness), element,
          "has a range with a softness by frequency, and no inertia about a fixed axis",
          "give the softness as a spring");
}

// Nothing else hangs on the links between the parts, which have no mass of their own.
void proper_links_of_balls(const Model& model, const Trees& trees) {
  std::set<string> bearers;
  for (const Site& site : model.sites) bearers.insert(site.link);
  for (const Collider& collider : model.colliders) bearers.insert(collider.link);
  for (const Loop& loop : model.loops) bearers.insert({loop.first, loop.second});
  for (std::size_t l = 0; l < model.links.size(); ++l) {
    const int own = trees.parent_joint[l];
    if (own < 0 || model.joints[static_cast<std::size_t>(own)].kind != JointKind::ball ||
        part_of_ball(model.joints[static_cast<std::size_t>(own)]) == 2)
      continue;
    const string element = quoted("link", model.links[l].name);
    require(trees.child_joints[l].size() == 1, element, "is within a ball joint, and other joints hang on it",
            "hang them on the ball's child");
    require(model.links[l].inertia.mass == 0.0 && model.links[l].inertia.about_center.isZero(0.0), element,
            "is within a ball joint, and has a mass or an inertia", "give them to the ball's child");
    require(bearers.count(model.links[l].name) == 0, element,
            "is within a ball joint, and bears a site, a collider or a loop", "let the ball's child bear it");
  }
}

void proper_place(const Joint& joint) {
  const string element = quoted("joint", joint.name);
  rigid(joint.origin, element, "origin");
  if (!joint.moves()) return;
  finite(joint.axis, element, "axis");
  require(joint.axis.norm() > 1e-9, element, "axis has no length", "give a direction such as 0 0 1");
}

void proper_motion(const Joint& joint) {
  const string element = quoted("joint", joint.name);
  if (joint.kind == JointKind::tendon) proper_tendon(joint, element);
  not_negative(joint.damping, element, "damping");
  not_negative(joint.armature, element, "armature");
  not_negative(joint.stiffness, element, "stiffness");
  finite(joint.rest, element, "rest position");
  proper_drive(joint.drive, element);
  proper_actuator(joint, element);
  finite(joint.effort, element, "effort");
  finite(joint.position, element, "position");
  finite(joint.velocity, element, "velocity");
  proper_bounds(joint, element);
}

// This makes the mass matrix positive definite at the model's start.
void moves_some_inertia(const Model& model, const Trees& trees, const std::vector<Inertia>& bodies) {
  const std::vector<UnmovedLink> unmoved = unmoved_links(model, trees, bodies);
  if (unmoved.empty()) return;
  const string element = quoted("link", model.links[unmoved.front().link].name);
  const string on_reading =
      "; or fill it in on reading: ImportOptions::least_mass and ImportOptions::least_inertia take bounds";
  const auto is_missing = [](const UnmovedLink& link) { return link.why == Unmoved::nothing; };
  if (unmoved.size() > 1 || is_missing(unmoved.front())) {
    std::vector<string> others = names_of(model, unmoved);
    others.erase(others.begin());
    throw ModelError(element,
                     "moves, but its joint has no mass or no inertia to move: its inertia is missing or 0" +
                         (others.empty() ? "" : "; the same holds for " + listed(others)),
                     "give an <inertial> to each, or to a link that is fixed to it" + on_reading);
  }
  const Unmoved why = unmoved.front().why;
  require(why != Unmoved::root, element, "floats but has no mass or no inertia",
          "give it an inertia, or bolt the root" + on_reading);
  const Joint& joint = model.joints[trees.parent_joint[unmoved.front().link]];
  const bool slides = joint.kind == JointKind::prismatic;
  require(why != Unmoved::axis, element,
          (slides ? "slides (joint '" : "turns (joint '") + joint.name + "') but has no " +
              (slides ? "mass" : "inertia about the axis"),
          "give it an <inertial> with both, or the joint an armature: Joint::armature" + on_reading);
  throw ModelError(
      element,
      "has no mass, and its joint '" + joint.name +
          "' moves the bodies behind it only as the joints between do, where the model starts",
      "give it an <inertial>, or the joint an armature: Joint::armature; or let the model start elsewhere" +
          on_reading);
}

using JointsByName = std::unordered_map<string, const Joint*>;

void proper_coupling(const JointsByName& joints, const Coupling& coupling, const string& name) {
  const string element = quoted("coupling", name);
  finite(coupling.offset, element, "offset gamma");
  require(!coupling.terms.empty(), element, "has only one joint", "name the joints that it follows");
  proper_softness(coupling.softness, element, "coupling");
  require(coupling.force_limit >= 0.0, element, "force limit is negative or NaN",
          "give more than 0, infinity for no limit");
  require(coupling.force_limit > 0.0, element, "force limit is 0: the coupling would hold nothing",
          "remove the coupling, or switch it off by Parameter::coupling_switch");
  std::set<string> seen;
  const auto moving = [&](const string& joint) {
    const auto found = joints.find(joint);
    require(found != joints.end(), element, "couples joint '" + joint + "', which does not exist", "correct the name");
    require(found->second->moves(), element, "couples joint '" + joint + "', which is fixed", "couple moving joints");
    require(found->second->kind != JointKind::ball, element, "couples joint '" + joint + "', a part of a ball joint",
            "couple joints with one axis; positions of a ball are no sums of turns");
    require(seen.insert(joint).second, element, "names joint '" + joint + "' twice", "add up the ratios");
  };
  moving(coupling.joint);
  if (coupling.function) proper_function(coupling, element);
  require(joints.at(coupling.joint)->kind != JointKind::tendon ||
              (is_hard(coupling.softness) && coupling.force_limit == infinity),
          element, "says what the position of a tendon is, and yet is soft or has a force limit",
          "leave it hard; give the tendon a spring, soft limits or an effort limit");
  for (const CouplingTerm& term : coupling.terms) {
    moving(term.joint);
    require(joints.at(term.joint)->kind != JointKind::tendon, element,
            "has tendon '" + term.joint + "' among its leaders", "name the joints of the tendon in its place");
    if (coupling.function) continue;
    finite(term.ratio, element, "gear ratio of joint '" + term.joint + "'");
    require(term.ratio != 0.0, element, "gear ratio of joint '" + term.joint + "' is 0",
            "remove the term; a joint that stands still is a fixed joint");
    require(
        std::abs(term.ratio) <= largest_ratio && std::abs(term.ratio) >= 1.0 / largest_ratio, element,
        "gear ratio of joint '" + term.joint + "' is beyond 1e-9 to 1e9: rounding leaves nothing of the smaller side",
        "check the ratio; write the coupling the other way round if need be");
  }
}

void one_coupling_each(const Model& model) {
  std::unordered_map<string, int> couplings;  // by follower
  for (const Coupling& coupling : model.couplings) ++couplings[coupling.joint];
  for (const Joint& joint : model.joints) {
    if (joint.kind != JointKind::tendon) continue;
    const int followed = couplings[joint.name];
    require(!is_spatial(joint) || followed == 0, quoted("joint", joint.name),
            "is a tendon with a path, and yet follows a coupling", "leave the path empty, or remove the coupling");
    require(is_spatial(joint) || followed == 1, quoted("joint", joint.name),
            "is a tendon that follows " + std::to_string(followed) + " couplings",
            "add the one coupling that says what its position is, or give it a path");
  }
}

void proper_site(const Model& model, const ByName& links, const Site& site) {
  if (links.find(site.link) < 0) model.link_index(site.link);  // which throws
  rigid(site.pose, quoted("site", site.name), "pose");
}

void proper_root(const Root& root) {
  const string element = quoted("root", root.link);
  rigid(root.pose, element, "pose");
  finite(root.velocity, element, "velocity");
  require(root.floating || root.velocity.isZero(0.0), element, "is bolted, but has a velocity",
          "let it float, or set its velocity to 0");
}

}  // namespace

void judge(const Model& model, const Attempt& attempt) {
  const bool has_names = attempt([&] {
    unique_names(model.links, "link");
    unique_names(model.joints, "joint");
    unique_names(model.sites, "site");
    unique_names(model.loops, "loop");
    unique_names(model.poses, "pose");
  });
  if (!has_names) return;
  bool is_placed = true;
  for (const Link& link : model.links) is_placed &= attempt([&] { proper_numbers(link); });
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Joint& joint = model.joints[j];
    is_placed &= attempt([&] { proper_place(joint); });
    if (joint.moves()) attempt([&] { proper_motion(joint); });
    if (joint.kind == JointKind::ball) is_placed &= attempt([&] { proper_ball(model, j); });
  }
  std::optional<Trees> trees;
  if (!is_placed || !attempt([&] { trees.emplace(model); })) return;
  if (!attempt([&] { proper_links_of_balls(model, *trees); })) return;
  attempt([&] {
    const std::vector<Inertia> bodies = rigid_bodies(model, *trees);
    possible_inertias(model, *trees, bodies);
    moves_some_inertia(model, *trees, bodies);
  });

  JointsByName joints_by_name;
  for (const Joint& joint : model.joints) joints_by_name.emplace(joint.name, &joint);
  const std::vector<string> names = coupling_names(model);
  bool are_coupled = true;
  for (std::size_t c = 0; c < model.couplings.size(); ++c)
    are_coupled &= attempt([&] { proper_coupling(joints_by_name, model.couplings[c], names[c]); });
  are_coupled &= attempt([&] { one_coupling_each(model); });
  if (!are_coupled) return;
  attempt([&] { curved_couplings(model); });
  for (const Joint& joint : model.joints)
    if (is_spatial(joint)) attempt([&] { proper_path(model, *trees, joint); });
  for (const Loop& loop : model.loops) attempt([&] { proper_loop(model, *trees, loop); });
  const ByName links(model.links);
  for (const Site& site : model.sites) attempt([&] { proper_site(model, links, site); });
  attempt([&] { contact_pairs(model, *trees); });
  for (const Root& root : model.roots) attempt([&] { proper_root(root); });
  for (const NamedPose& pose : model.poses) attempt([&] { proper_pose(model, pose); });
  attempt([&] {
    finite(model.gravity, quoted("model", model.name), "gravity");
    not_negative(model.time_step, quoted("model", model.name), "time step");
  });
}

void Model::validate() const {
  judge(*this, [](const std::function<void()>& judge_part) {
    judge_part();
    return true;
  });
}

}  // namespace lockstep
