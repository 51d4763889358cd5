// <loop_joint>, as Isaac Sim and old Drake read it. SPDX-License-Identifier: Apache-2.0
#include "loop_joints.h"

#include <fmt/format.h>

#include <unordered_map>

#include "origin.h"

namespace lockstep::importer::urdf {
namespace {

const std::unordered_map<std::string, LoopKind> types = {
    {"spherical", LoopKind::point},  {"ball", LoopKind::point},       {"revolute", LoopKind::hinge},
    {"continuous", LoopKind::hinge}, {"prismatic", LoopKind::slider}, {"fixed", LoopKind::weld}};

// <link1 link xyz rpy>
std::string read_end(Element end, Pose& pose) {
  std::string link = end.name("link");
  pose = read_pose(end);
  end.tally_rest();
  return link;
}

Loop read_loop(Element& element) {
  Loop loop;
  loop.name = element.name("name");
  element.rename("loop_joint '" + loop.name + "'");
  const std::string type = element.name("type");
  const auto kind = types.find(type);
  if (kind == types.end())
    element.fail("is of type '" + shortened(type) + "', which closes no loop that lockstep has",
                 "write spherical, revolute, continuous, prismatic or fixed; or leave all such elements out: "
                 "ImportOptions::leave_out_foreign");
  loop.kind = kind->second;
  loop.first = read_end(element.only_child("link1"), loop.first_pose);
  loop.second = read_end(element.only_child("link2"), loop.second_pose);
  if (loop.kind == LoopKind::hinge || loop.kind == LoopKind::slider) {
    loop.axis = Eigen::Vector3d::UnitX();  // as in joints
    if (std::optional<Element> axis = element.child("axis")) {
      loop.axis = axis->triple("xyz");
      axis->tally_rest();
    }
  }
  for (const char* const lacking : {"limit", "dynamics"})
    if (element.child(lacking)) element.report().warn("limits and dynamics of loop joints, left out", element.title());
  element.tally_rest(" of loop joints");
  return loop;
}

}  // namespace

void read_loop_joints(Element& element, const ImportOptions& options, Robot& robot) {
  element.each_child("loop_joint", [&](Element loop) {
    if (options.leave_out_foreign)
      return element.report().warn("left out on request",
                                   fmt::format("{} {}closes a loop", loop.title(),
                                               loop.has("name") ? fmt::format("'{}' ", loop.name("name")) : ""));
    element.report().attempt([&] {
      robot.model.loops.push_back(read_loop(loop));
      robot.places["loop '" + robot.model.loops.back().name + "'"] = loop.place();
    });
  });
}

}  // namespace lockstep::importer::urdf
