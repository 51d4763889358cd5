// <actuator>, and <keyframe>s with their controls. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <unordered_map>
#include <unordered_set>

#include "export/names.h"
#include "model/joint_motion.h"
#include "model/poses.h"
#include "model/tendons.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

const char* const controls_line = "controls of the file, in its order";

class Actuators {
 public:
  explicit Actuators(const Writing& writing)
      : model_(writing.model),
        layout_(writing.layout),
        trees_(writing.trees),
        timestep_(writing.timestep),
        report_(writing.report),
        xml_(writing.xml) {
    for (const Coupling& coupling : model_.couplings) {
      offsets_.emplace(coupling.joint, coupling.offset);
      if (is_hard(coupling.softness)) followers_.insert(coupling.joint);
    }
    for (const Joint& joint : model_.joints) offsets_.emplace(joint.name, 0.0);
    report_.show_all(controls_line);
  }

  void write() {
    for (const Joint& joint : model_.joints)
      if (joint.moves()) add(joint);
    if (!controls_.empty()) xml_.close();
    for (const int j : pulled_)
      report_.warn("effort limits of joints that a driven tendon moves, which bound its force too in MuJoCo",
                   model_.joints[static_cast<std::size_t>(j)].name);
    write_keys();
  }

 private:
  static bool is_tendon(const Joint& joint) { return joint.kind == JointKind::tendon; }

  // Without a motor, a reader may take such a tendon for a coupling.
  static bool has_spring_alone(const Joint& tendon) {
    return tendon.lower == -infinity && tendon.upper == infinity && tendon.friction == 0.0 && tendon.armature == 0.0;
  }

  void add(const Joint& joint) {
    const Drive& drive = joint.drive;
    const std::size_t first = controls_.size();
    if (drive.kinematic) report_.warn("kinematic drives, left out", joint.name);
    if (drive.stall_effort < infinity)
      report_.warn("efforts of motors that fall with speed, kept as effort limits alone", joint.name);
    // A velocity target that is not 0 has a control of its own.
    const bool is_apart = drive.kp > 0.0 && drive.kd > 0.0 &&
                          (drive.velocity_target != 0.0 || is_in_a_pose(joint, &NamedPose::velocity_targets));
    if (drive.kp > 0.0) write(joint, Aim::position, drive.kp, {0.0, -drive.kp, is_apart ? 0.0 : -drive.kd});
    if (drive.kd > 0.0 && (is_apart || drive.kp == 0.0)) write(joint, Aim::velocity, drive.kd, {0.0, 0.0, -drive.kd});
    const bool has_no_drive = drive.kp == 0.0 && drive.kd == 0.0 && !drive.kinematic;
    const bool is_limited = joint.effort_limit < infinity && (is_tendon(joint) || !followers_.contains(joint.name));
    const bool is_late = drive.lag > 0.0 || drive.delay > 0;
    const bool is_motor =
        has_no_drive && (is_limited || is_late || (is_tendon(joint) && !is_spatial(joint) && has_spring_alone(joint)));
    if (joint.effort != 0.0 || is_in_a_pose(joint, &NamedPose::efforts) || is_motor) write(joint, Aim::effort, 1.0, {});
    if (joint.kind == JointKind::ball && joint.effort_limit < infinity && controls_.size() > first + 1)
      report_.warn("effort limits of parts of balls, which each of several actuators has to itself", joint.name);
  }

  // Joints whose own effort limits MuJoCo takes for what a tendon does to them, too.
  void note_limits_under(const Joint& tendon) {
    const auto note = [&](int j) {
      const Joint& joint = model_.joints[static_cast<std::size_t>(j)];
      if (joint.effort_limit < infinity && joint.kind != JointKind::ball) pulled_.insert(j);
    };
    for (const Coupling& coupling : model_.couplings)
      for (const CouplingTerm& term : coupling.terms)
        if (coupling.joint == tendon.name) note(model_.joint_index(term.joint));
    const auto carrier = [&](int link) { return trees_.parent_joint[static_cast<std::size_t>(link)]; };
    for (const TendonSegment& segment : tendon.path)
      for (const std::string& link : {segment.first, segment.second})
        for (int j = link.empty() ? -1 : carrier(model_.link_index(link)); j >= 0;
             j = carrier(trees_.joint_parent[static_cast<std::size_t>(j)]))
          note(j);
  }

  enum class Aim { position, velocity, effort };

  // Whether a pose has a number that is not 0 of it.
  bool is_in_a_pose(const Joint& joint, std::map<std::string, double> NamedPose::*numbers) const {
    return std::any_of(model_.poses.begin(), model_.poses.end(), [&](const NamedPose& pose) {
      const auto found = (pose.*numbers).find(joint.name);
      return found != (pose.*numbers).end() && found->second != 0.0;
    });
  }

  void write(const Joint& joint, Aim aim, double gain, std::initializer_list<double> bias) {
    if (controls_.empty()) xml_.open("actuator");
    const char* const what = aim == Aim::position ? "position" : aim == Aim::velocity ? "velocity" : "effort";
    const bool is_motor = bias.size() == 0;
    const double lag = joint.drive.lag;
    const int delay = joint.drive.delay;
    xml_.open(is_motor && lag == 0.0 ? "motor" : "general").set("name", names_.take(joint.name + "_" + what));
    if (joint.kind == JointKind::ball)
      write_ball_target(joint);
    else
      xml_.set(is_tendon(joint) ? "tendon" : "joint", joint.name);
    if (!is_motor) xml_.set("biastype", "affine").set("gainprm", numbers(gain)).set("biasprm", numbers(bias));
    if (lag > 0.0) xml_.set("dyntype", "filterexact").set("dynprm", numbers(lag));
    if (delay > 0) xml_.set("delay", numbers(delay * timestep_)).set("nsample", std::to_string(delay));
    xml_.close();
    if (is_tendon(joint)) note_limits_under(joint);
    controls_.push_back({&joint - model_.joints.data(), aim});
    report_.remark(controls_line, fmt::format("{} of {}", what, joint.name));
  }

  void write_ball_target(const Joint& joint) {
    const Joint* const parts = &joint - part_of_ball(joint);
    xml_.set("joint", ball_name(*parts)).set("gear", numbers(joint.axis));
    if (joint.effort_limit < infinity) {
      const double limit = std::max(joint.effort_limit, 1e-300);
      xml_.set("forcelimited", "true").set("forcerange", numbers({-limit, limit}));
    }
  }

  struct Key {
    std::vector<double> q, v, u;
    std::vector<double> lagged;  // controls as they arrive
    bool operator==(const Key& other) const = default;
  };

  // Where a model of these joints and roots starts. MuJoCo's free joints move linearly in world axes, then turn in the
  // body's.
  Key key_of(const Model& model) const {
    Key key;
    auto& [q, v, u, lagged] = key;
    const auto append = [](std::vector<double>& to, std::initializer_list<double> values) {
      to.insert(to.end(), values);
    };
    for (const Body& body : layout_.bodies) {
      if (body.floats) {
        const Root& root = root_of(model, body);
        const Eigen::Vector3d at = root.pose.translation(), linear = root.pose.linear() * root.velocity.tail<3>();
        const Eigen::Quaterniond turn = Eigen::Quaterniond(root.pose.linear()).normalized();
        append(q, {at[0], at[1], at[2], turn.w(), turn.x(), turn.y(), turn.z()});
        append(v, {linear[0], linear[1], linear[2], root.velocity[0], root.velocity[1], root.velocity[2]});
      }
      for (const JointPlace& place : body.joints) {
        const Joint* const joint = &model.joints[static_cast<std::size_t>(place.joint)];
        v.push_back(joint->velocity);
        if (joint->kind != JointKind::ball) {
          q.push_back(joint->position);
        } else if (!is_inner_part(*joint)) {
          const Eigen::Quaterniond turn = turned_by({joint[0].position, joint[1].position, joint[2].position});
          append(q, {turn.w(), turn.x(), turn.y(), turn.z()});
        }
      }
    }
    for (const auto& [number, aim] : controls_) {
      const Joint& joint = model.joints[static_cast<std::size_t>(number)];
      if (aim == Aim::position)
        u.push_back(joint.drive.position_target + (is_tendon(joint) ? offsets_.at(joint.name) : 0.0));
      else
        u.push_back(aim == Aim::velocity ? joint.drive.velocity_target : joint.effort);
      if (joint.drive.lag > 0.0) lagged.push_back(u.back());
    }
    return key;
  }

  void write_key(const std::string& name, const Key& key) {
    xml_.open("key").set("name", name).set("qpos", numbers(key.q)).set("qvel", numbers(key.v));
    if (!key.u.empty()) xml_.set("ctrl", numbers(key.u));
    if (!key.lagged.empty()) xml_.set("act", numbers(key.lagged));
    xml_.close();
  }

  void write_keys() {
    const Key start = key_of(model_);
    if (start.q.empty()) return;
    xml_.open("keyframe");
    Names names;
    write_key(names.take("start"), start);
    report_.remark("state and targets of the start, in a keyframe", "start");
    for (const NamedPose& pose : model_.poses) {
      const Key key = key_of(started_in(pose, model_));
      if (pose.name == "start" && key == start) continue;
      const std::string name = names.take(pose.name);
      write_key(name, key);
      report_.remark("poses, in keyframes", name == pose.name ? name : pose.name + " as " + name);
    }
    xml_.close();

    std::vector<std::string> own, order;
    for (const Body& body : layout_.bodies)
      for (const JointPlace& place : body.joints)
        order.push_back(model_.joints[static_cast<std::size_t>(place.joint)].name);
    for (const Joint& joint : model_.joints)
      if (joint.moves() && !is_tendon(joint)) own.push_back(joint.name);
    if (own != order)
      for (const std::string& joint : order) report_.remark("joints in MuJoCo's order, depth first", joint);
  }

  static const Root& root_of(const Model& model, const Body& body) {
    const std::string& link = model.links[static_cast<std::size_t>(body.link)].name;
    return *std::find_if(model.roots.begin(), model.roots.end(), [&](const Root& root) { return root.link == link; });
  }

  const Model& model_;
  const Layout& layout_;
  const Trees& trees_;
  const double timestep_;
  Report& report_;
  Xml& xml_;
  Names names_;
  std::set<int> pulled_;  // limited joints under driven tendons
  std::unordered_set<std::string> followers_;
  std::unordered_map<std::string, double> offsets_;  // of the first coupling that a joint follows, or 0
  struct Control {
    std::ptrdiff_t joint;
    Aim aim;
  };
  std::vector<Control> controls_;  // in the file's order
};

}  // namespace

void write_actuators_and_start(const Writing& writing) { Actuators(writing).write(); }

}  // namespace lockstep::exporter::mjcf
