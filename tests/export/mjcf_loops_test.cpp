// What MJCF says of loops, and what it loses. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "export/export_helpers.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

using std::string;

// Two fingers that a loop of each kind holds together, and a third that the world holds.
Model with_loops() {
  Model model = fingers();
  model.couplings.clear();
  Pose one = Pose::Identity(), other = Pose::Identity();
  one.translation() = Eigen::Vector3d(0.1, 0.2, 0.3), other.translation() = Eigen::Vector3d(-0.2, 0.1, 0.05);
  one.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  other.linear() = Eigen::AngleAxisd(1.1, Eigen::Vector3d(3, -2, 1).normalized()).toRotationMatrix();
  for (const LoopKind kind : all_loop_kinds) {
    Loop loop;
    loop.name = to_string(kind), loop.kind = kind;
    loop.first = "l0", loop.second = "l1";
    loop.first_pose = one, loop.second_pose = other;
    loop.axis = {1.0, 0.0, 2.0};
    model.loops.push_back(loop);
    loop.name += " in the world", loop.first = "", loop.second = "l2";
    model.loops.push_back(loop);
  }
  return model;
}

TEST(MjcfExport, holds_loops_by_points_and_welds) {
  const Model model = with_loops();
  const Export made = export_mjcf(model);
  EXPECT_TRUE(warns(made, "sliders of loops, left out (2): slider, slider in the world")) << report_of(made);
  EXPECT_TRUE(reports(made, "hinges of loops, as two points on the axis (2): hinge, hinge in the world"));
  EXPECT_TRUE(reports(made, "points of loops, held by sites (6): point, "));
  EXPECT_EQ(made.warnings.size(), 1u) << report_of(made);
  // A hinge is two points, 0.1 m apart along its axis in both frames.
  Model wanted = model;
  wanted.loops.clear();
  for (const Loop& own : model.loops) {
    Loop loop = own;
    if (own.kind == LoopKind::slider) continue;
    if (own.kind == LoopKind::hinge) {
      loop.kind = LoopKind::point;
      wanted.loops.push_back(loop);
      loop.name += "_axis";
      for (Pose* pose : {&loop.first_pose, &loop.second_pose}) pose->translate(0.1 * own.axis.normalized());
    }
    wanted.loops.push_back(loop);
  }
  const Model again = read(made);
  const Except except = {.sites = true};
  expect_same(mechanism_of(again, except), mechanism_of(wanted, except));

  // What was read has the sites already.
  const Export once_more = export_mjcf(again);
  EXPECT_EQ(std::count(once_more.text.begin(), once_more.text.end(), '\n'),
            std::count(made.text.begin(), made.text.end(), '\n'));
  expect_same(mechanism_of(read(once_more)), mechanism_of(again));
}

TEST(MjcfExport, says_what_loops_lose) {
  Model model = with_loops();
  model.loops[0].softness = Spring{1e4, 10.0};
  model.loops[1].softness = Hard{0.3};
  model.loops[2].torque_limit = 2.0;
  const Export made = export_mjcf(model);
  EXPECT_TRUE(warns(made, "softness of loops, left out: they are hard (1): point"));
  EXPECT_TRUE(warns(made, "force limits of loops, left out (1): hinge"));
  EXPECT_TRUE(reports(made, "shares of an error that a step corrects (erp), left out (1): point in the world"));
}

// MuJoCo has one set of names for all equalities.
TEST(MjcfExport, renames_loops_that_have_the_name_of_a_coupling) {
  Model model = with_loops();
  model.couplings = {Coupling::mimic("j2", "j0", -1.0)};
  model.loops[0].name = "j2";
  const Export made = export_mjcf(model);
  EXPECT_TRUE(reports(made, "loops with the name of a coupling, renamed (1): j2 to j2#2")) << report_of(made);
  EXPECT_NE(made.text.find("<connect name=\"j2#2\""), string::npos);
}

// Loops may hold a link without mass: it is no part of the next body then.
TEST(MjcfExport, keeps_links_that_loops_hold) {
  Model model = wrist();
  Loop loop;
  loop.name = "ring", loop.first = "", loop.second = "roll";
  model.loops.push_back(loop);
  EXPECT_NE(export_mjcf(model).text.find("<body name=\"roll\""), string::npos);
}

}  // namespace
}  // namespace lockstep
