// What URDF says of a Model, and what its report says. SPDX-License-Identifier: Apache-2.0
#include "export/urdf/rpy.h"

#include <algorithm>
#include <cmath>

#include "export/export_helpers.h"
#include "scenes/scenes.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

TEST(Rpy, gives_the_rotation_back_however_steep_the_pitch) {
  const double half = std::acos(0.0);
  for (const double off : {0.0, 1e-17, 1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 0.3})
    for (const double sign : {-1.0, 1.0})
      for (const double roll : {-3.0, 0.0, 0.4})
        for (const double yaw : {-2.0, 0.0, 1.3}) {
          const auto rotation = [](const Vector3d& rpy) -> Eigen::Matrix3d {
            return (AngleAxisd(rpy[2], Vector3d::UnitZ()) * AngleAxisd(rpy[1], Vector3d::UnitY()) *
                    AngleAxisd(rpy[0], Vector3d::UnitX()))
                .toRotationMatrix();
          };
          const Eigen::Matrix3d wanted = rotation({roll, sign * (half - off), yaw});
          EXPECT_LT((rotation(exporter::urdf::rpy_of(wanted)) - wanted).norm(), 2e-15)
              << off << ' ' << roll << ' ' << yaw;
        }
}

TEST(UrdfExport, says_what_it_cannot_say) {
  Model model = fingers();
  model.gravity = {0.0, 0.0, -1.62};
  Joint& lead = model.joints[0];
  lead.drive.kp = 1.0, lead.effort = 1.0, lead.armature = 1.0, lead.stiffness = 1.0, lead.effort_limit = 0.0;
  lead.velocity = 1.0, lead.position = 0.2, lead.restitution = 0.5, lead.upper = 2.0;
  model.joints[2].drive.delay = 3;
  model.joints[1].upper = 3.0, model.joints[1].limit_softness = Spring{1.0, 1.0};
  model.joints[2].lower = -1.0, model.joints[2].upper = 1.0, model.joints[2].limit_softness = Hard{0.1};
  model.couplings[0].softness = Frequency{30.0, 1.0};
  model.couplings[0].force_limit = 2.0;
  model.couplings.push_back({"j2", {{"j0", 1.0}, {"j1", 1.0}}, 0.0, Hard{}});
  model.couplings.push_back(Coupling::mimic("j1", "j2", 1.0));
  model.couplings.push_back(Coupling::mimic("j0", "j1", 1.0));
  model.roots = {{"base", true, Pose::Identity(), Twist::Ones()}};
  model.links[0].inertia = Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero());
  model.links[0].gravity = 0.5;
  model.colliders = {{.name = "floor", .shape = Shape::half_space()},
                     {.name = "ball", .link = "l1", .shape = Shape::sphere(0.1)},
                     {.name = "rod", .link = "l1", .shape = Shape::capsule(0.1, 0.2)}};
  model.contacts = {{"floor", "ball"}};
  const Export made = export_urdf(model);
  for (const char* line :
       {"gravity, left out (1): 0 0 -1.62", "shares of gravity, left out (1): base",
        "velocities of roots, left out (1): base", "drives, left out (2): j0, j2", "efforts, left out (1): j0",
        "armatures, left out (1): j0", "springs of joints, left out (1): j0",
        "effort limits of 0, which readers of URDF take for none (1): j0", "velocities of the start, left out (1): j0",
        "positions of the start, left out (1): j0", "restitution of position limits, left out (1): j0",
        "softness of position limits, left out (1): j1", "softness of couplings, left out: mimics are hard (1): j1",
        "force limits of couplings, left out (1): j1", "couplings of more than two joints, left out (1): j2",
        "second couplings of a joint, left out (1): j1#2", "couplings that close a circle of mimics, left out (1): j0",
        "colliders of the world, left out (1): floor", "contacts, left out (1): floor-ball"})
    EXPECT_TRUE(warns(made, line)) << line << "\n" << report_of(made);
  for (const char* line :
       {"shares of an error that a step corrects (erp), left out (1): j2",
        "capsules, which some readers of URDF lack (1): rod",
        "roots that float or stand apart, on joints of a link for the world (1): base",
        "colliders, without their friction and group (2): ball, rod", "limits without an end, written as 1e+10"})
    EXPECT_TRUE(reports(made, line)) << line << "\n" << report_of(made);
  EXPECT_EQ(made.warnings.size(), 19u) << report_of(made);
}

TEST(UrdfExport, hangs_several_roots_on_the_world) {
  Model model = fingers();
  model.links[0].inertia = Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero());
  model.links.push_back({"world", Inertia::box(1.0, {0.1, 0.1, 0.1}, Vector3d::Zero())});
  model.roots = {{"base"}, {"world", true}};
  model.roots[0].pose.translation() = Vector3d(1.0, 2.0, 3.0);
  model.roots[1].pose.linear() = AngleAxisd(0.5, Vector3d::UnitX()).toRotationMatrix();
  const Export made = export_urdf(model);
  EXPECT_EQ(made.warnings.size(), 0u) << report_of(made);
  expect_same(mechanism_of(import_urdf(made.text).model), mechanism_of(model));
}

TEST(UrdfExport, writes_sites_as_links_and_shapes_as_collisions) {
  Model model = fingers();
  model.add_site("tip", "l1").pose.translation() = Vector3d(0.0, 0.0, 0.1);
  model.colliders = {{.name = "box", .link = "l1", .shape = Shape::box({0.1, 0.2, 0.3}), .group = "robot"},
                     {.name = "rod", .link = "l1", .shape = Shape::capsule(0.1, 0.2), .group = "robot"},
                     {.name = "can", .link = "l1", .shape = Shape::cylinder(0.1, 0.3), .group = "robot"}};
  const Model again = import_urdf(export_urdf(model).text, "exported", {.colliders = true}).model;
  const Joint& fixed = again.joints.back();
  EXPECT_EQ(fixed.child, "tip");
  EXPECT_EQ(fixed.parent, "l1");
  EXPECT_EQ(fixed.origin.matrix(), model.sites[0].pose.matrix());
  ASSERT_EQ(again.colliders.size(), 3u);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(again.colliders[c].shape.kind, model.colliders[c].shape.kind);
    EXPECT_EQ(again.colliders[c].shape.size, model.colliders[c].shape.size);
  }
}

TEST(UrdfExport, keeps_chains_of_mimics) {
  Model model = fingers();
  model.couplings.push_back(Coupling::mimic("j2", "j1", -0.5, -0.03));
  model.joints[2].position = 0.08;
  const Export made = export_urdf(model);
  EXPECT_TRUE(made.warnings.empty()) << report_of(made);
  const Model again = import_urdf(made.text).model;
  EXPECT_NEAR(again.joints[2].position, 0.08, 1e-15);
  EXPECT_EQ(again.couplings[1].terms[0].joint, "j0");
  EXPECT_NEAR(again.couplings[1].terms[0].ratio, -1.0, 1e-15);
}

TEST(UrdfExport, leaves_out_tendons_by_name) {
  Model model = scenes::scene("chain8").model;
  const std::size_t joints = model.joints.size(), couplings = model.couplings.size();
  Joint tendon;
  tendon.name = "sum", tendon.kind = JointKind::tendon, tendon.stiffness = 1.0;
  model.joints.push_back(tendon);
  model.couplings.push_back({"sum", {{model.joints[1].name, -1.0}}, 0.0, Hard{}, infinity});
  const Export made = export_urdf(model);
  EXPECT_EQ(made.report.front().find("tendon"), std::string::npos) << made.report.front();
  EXPECT_NE(std::find(made.warnings.begin(), made.warnings.end(), "tendons, left out (1): sum"), made.warnings.end());
  const Model again = import_urdf(made.text).model;
  EXPECT_EQ(again.joints.size(), joints);
  EXPECT_EQ(again.couplings.size(), couplings);
}

TEST(UrdfExport, refuses_what_moves_by_its_armature_alone) {
  Model model = fingers();
  ASSERT_NO_THROW(export_urdf(model));
  model.links[2].inertia = {};
  model.joints[1].armature = 0.01;
  ASSERT_NO_THROW(model.validate());
  try {
    export_urdf(model);
    FAIL() << "nobody can read what it writes";
  } catch (const ModelError& error) {
    EXPECT_EQ(error.element(), "link '" + model.links[2].name + "'");
  }
}

TEST(UrdfExport, writes_loops_as_loop_joints) {
  for (const bool floats : {false, true}) {
    Model model = fingers();
    model.couplings.clear(), model.joints[1].position = 0.0;
    if (floats) model.roots = {{"base", true}};
    for (const LoopKind kind : all_loop_kinds) {
      Loop loop;
      loop.name = to_string(kind), loop.kind = kind;
      loop.first = kind == LoopKind::slider ? "" : "l0", loop.second = "l1";
      loop.first_pose.translation() = Eigen::Vector3d(0.1, 0.2, 0.3);
      loop.second_pose.linear() = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
      loop.axis = {1.0, 0.0, 2.0};
      model.loops.push_back(loop);
    }
    const Export made = export_urdf(model);
    EXPECT_TRUE(made.warnings.empty()) << report_of(made);
    expect_same(mechanism_of(import_urdf(made.text).model), mechanism_of(model));
    model.loops[0].softness = Spring{1e4, 10.0};
    model.loops[1].force_limit = 3.0;
    model.couplings = {Coupling::cam("j1", "j0", Polynomial{{0.0, 1.0, 0.5}})};
    const Export lossy = export_urdf(model);
    EXPECT_TRUE(warns(lossy, "softness of loops, left out (1): point")) << report_of(lossy);
    EXPECT_TRUE(warns(lossy, "force limits of loops, left out (1): hinge"));
    EXPECT_TRUE(warns(lossy, "followers by a function, left out (1): j1"));
  }
}

}  // namespace
}  // namespace lockstep
