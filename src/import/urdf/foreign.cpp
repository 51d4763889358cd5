// Foreign elements, by name. SPDX-License-Identifier: Apache-2.0
#include "foreign.h"

#include <fmt/format.h>

#include <algorithm>

namespace lockstep::importer::urdf {
namespace {

struct Kind {
  const char* tag;
  const char* what;
};

// Children of <robot>.
constexpr Kind kinds[] = {
    {"loop", "closes a loop (URDF+)"},
    {"coupling", "couples joints (URDF+)"},
    {"constraint", "constrains links or joints"},
    {"drake:joint", "is a joint of Drake's"},
    {"drake:ball_constraint", "closes a loop (Drake)"},
    {"drake:distance_constraint", "closes a loop (Drake)"},
    {"drake:coupler_constraint", "couples joints (Drake)"},
    {"drake:linear_bushing_rpy", "closes a loop by springs (Drake)"},
};

class Judge {
 public:
  Judge(const std::vector<std::string>& followers, const ImportOptions& options)
      : followers_(followers), leave_out_(options.leave_out_foreign) {}

  void operator()(const Element& element, const std::string& name, const std::string& what) const {
    if (!leave_out_)
      return element.refuse_later(name + what + ", which is no URDF and changes the mechanism",
                                  "build it from URDF's own joints and <mimic>, or leave all such elements out: "
                                  "ImportOptions::leave_out_foreign");
    element.report().warn("left out on request", element.title() + " " + name + what);
  }

  void coupling(const Element& element, const std::string& follower, const char* whose) const {
    if (std::find(followers_.begin(), followers_.end(), follower) == followers_.end())
      (*this)(element, "", fmt::format("couples joint '{}' {}", shortened(follower), whose));
  }

 private:
  const std::vector<std::string>& followers_;
  bool leave_out_;
};

// In Gazebo's mimic plugins <joint> or <jointName> is the leader.
void judge_gazebo(Element& gazebo, const Judge& judge) {
  gazebo.each_child("joint", [&](Element joint) {
    judge(joint, joint.has("name") ? fmt::format("'{}' ", joint.name("name")) : "",
          "is a joint for Gazebo alone: it closes a loop");
  });
  gazebo.each_child("plugin", [&](Element plugin) {
    plugin.each_child("mimicJoint",
                      [&](const Element& follower) { judge.coupling(plugin, follower.text(), "for Gazebo alone"); });
  });
}

void judge_control(Element& control, const Judge& judge) {
  control.each_child("joint", [&](Element joint) {
    joint.each_child("param", [&](Element param) {
      if (param.has("name") && param.name("name") == "mimic" && joint.has("name"))
        judge.coupling(joint, joint.name("name"), "for ros2_control alone");
    });
  });
}

}  // namespace

void judge_foreign(Element& robot, const std::vector<std::string>& followers, const ImportOptions& options) {
  const Judge judge(followers, options);
  for (const Kind& kind : kinds)
    robot.each_child(kind.tag, [&](Element element) {
      judge(element, element.has("name") ? fmt::format("'{}' ", element.name("name")) : "", kind.what);
    });
  robot.each_child("mujoco", [&](Element mujoco) {
    robot.report().not_used("mujoco");
    for (const char* tag : {"equality", "tendon"})
      mujoco.each_child(
          tag, [&](const Element& element) { judge(element, "", "couples joints or bodies for MuJoCo alone"); });
  });
  robot.each_child("gazebo", [&](Element gazebo) {
    robot.report().not_used("gazebo");
    judge_gazebo(gazebo, judge);
  });
  robot.each_child("ros2_control", [&](Element control) {
    robot.report().not_used("ros2_control");
    judge_control(control, judge);
  });
}

}  // namespace lockstep::importer::urdf
