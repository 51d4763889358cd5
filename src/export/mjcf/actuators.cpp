// <actuator>, and <keyframe> with their controls. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include "export/names.h"
#include "sections.h"

namespace lockstep::exporter::mjcf {
namespace {

const char* const controls_line = "controls of the file, in its order";

class Actuators {
 public:
  explicit Actuators(const Writing& writing)
      : model_(writing.model), layout_(writing.layout), report_(writing.report), xml_(writing.xml) {
    for (const Coupling& coupling : model_.couplings) {
      offsets_.emplace(coupling.joint, coupling.offset);
      if (is_hard(coupling.softness)) followers_.insert(coupling.joint);
    }
    report_.show_all(controls_line);
  }

  void write() {
    for (const Joint& joint : model_.joints)
      if (joint.moves()) add(joint);
    if (!control_.empty()) xml_.close();
    write_start();
  }

 private:
  static bool is_tendon(const Joint& joint) { return joint.kind == JointKind::tendon; }

  // Without a motor, a reader may take such a tendon for a coupling.
  static bool has_spring_alone(const Joint& tendon) {
    return tendon.lower == -infinity && tendon.upper == infinity && tendon.friction == 0.0 && tendon.armature == 0.0;
  }

  void add(const Joint& joint) {
    const Drive& drive = joint.drive;
    if (drive.kinematic) report_.warn("kinematic drives, left out", joint.name);
    // A velocity target that is not 0 has a control of its own.
    const bool is_apart = drive.kp > 0.0 && drive.kd > 0.0 && drive.velocity_target != 0.0;
    if (drive.kp > 0.0)
      write(joint, "position", drive.kp, {0.0, -drive.kp, is_apart ? 0.0 : -drive.kd},
            drive.position_target + (is_tendon(joint) ? offsets_.at(joint.name) : 0.0));
    if (drive.kd > 0.0 && (is_apart || drive.kp == 0.0))
      write(joint, "velocity", drive.kd, {0.0, 0.0, -drive.kd}, drive.velocity_target);
    const bool has_no_drive = drive.kp == 0.0 && drive.kd == 0.0 && !drive.kinematic;
    const bool is_limited = joint.effort_limit < infinity && (is_tendon(joint) || !followers_.contains(joint.name));
    const bool is_motor = has_no_drive && (is_limited || (is_tendon(joint) && has_spring_alone(joint)));
    if (joint.effort != 0.0 || is_motor) write(joint, "effort", 1.0, {}, joint.effort);
  }

  void write(const Joint& joint, const char* what, double gain, std::initializer_list<double> bias, double control) {
    if (control_.empty()) xml_.open("actuator");
    const bool is_motor = bias.size() == 0;
    xml_.open(is_motor ? "motor" : "general").set("name", names_.take(joint.name + "_" + what));
    xml_.set(is_tendon(joint) ? "tendon" : "joint", joint.name);
    if (!is_motor) xml_.set("biastype", "affine").set("gainprm", numbers(gain)).set("biasprm", numbers(bias));
    xml_.close();
    control_.push_back(control);
    report_.remark(controls_line, fmt::format("{} of {}", what, joint.name));
  }

  // MuJoCo's free joints move linearly in world axes, then turn in the body's.
  void write_start() {
    std::vector<double> q, v;
    std::vector<std::string> order;
    const auto append = [](std::vector<double>& to, std::initializer_list<double> values) {
      to.insert(to.end(), values);
    };
    for (const Body& body : layout_.bodies) {
      if (body.floats) {
        const Root& root = root_of(body);
        const Eigen::Vector3d at = root.pose.translation(), linear = root.pose.linear() * root.velocity.tail<3>();
        const Eigen::Quaterniond turn = Eigen::Quaterniond(root.pose.linear()).normalized();
        append(q, {at[0], at[1], at[2], turn.w(), turn.x(), turn.y(), turn.z()});
        append(v, {linear[0], linear[1], linear[2], root.velocity[0], root.velocity[1], root.velocity[2]});
      }
      for (const JointPlace& place : body.joints) {
        const Joint& joint = model_.joints[static_cast<std::size_t>(place.joint)];
        q.push_back(joint.position), v.push_back(joint.velocity);
        order.push_back(joint.name);
      }
    }
    if (q.empty()) return;
    xml_.open("keyframe").open("key").set("name", "start").set("qpos", numbers(q)).set("qvel", numbers(v));
    if (!control_.empty()) xml_.set("ctrl", numbers(control_));
    xml_.close().close();
    report_.remark("state and targets of the start, in a keyframe", "start");
    std::vector<std::string> own;
    for (const Joint& joint : model_.joints)
      if (joint.moves() && !is_tendon(joint)) own.push_back(joint.name);
    if (own != order)
      for (const std::string& joint : order) report_.remark("joints in MuJoCo's order, depth first", joint);
  }

  const Root& root_of(const Body& body) const {
    const std::string& link = model_.links[static_cast<std::size_t>(body.link)].name;
    return *std::find_if(model_.roots.begin(), model_.roots.end(), [&](const Root& root) { return root.link == link; });
  }

  const Model& model_;
  const Layout& layout_;
  Report& report_;
  Xml& xml_;
  Names names_;
  std::unordered_set<std::string> followers_;
  std::unordered_map<std::string, double> offsets_;  // of the first coupling that a joint follows
  std::vector<double> control_;
};

}  // namespace

void write_actuators_and_start(const Writing& writing) { Actuators(writing).write(); }

}  // namespace lockstep::exporter::mjcf
