// Model::validate refuses what breaks a rule, and names the element and the rule. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>

#include "lockstep/error.h"
#include "lockstep/model.h"

namespace lockstep {
namespace {

// A root with two coupled joints in series.
Model two_joints() {
  Model model;
  const Inertia box = Inertia::box(0.2, {0.1, 0.04, 0.04}, {0.05, 0, 0});
  model.links = {{"base", {}}, {"upper", box}, {"lower", box}};
  Joint shoulder, elbow;
  shoulder.name = "shoulder", shoulder.kind = JointKind::revolute;
  shoulder.parent = "base", shoulder.child = "upper", shoulder.axis = Eigen::Vector3d::UnitY();
  elbow = shoulder;
  elbow.name = "elbow", elbow.parent = "upper", elbow.child = "lower";
  elbow.origin.translation() = Eigen::Vector3d(0.1, 0, 0);
  model.joints = {shoulder, elbow};
  model.couplings = {Coupling::mimic("elbow", "shoulder", -1.0)};
  model.sites = {{"tip", "lower", Eigen::Isometry3d::Identity()}};
  return model;
}

struct Rule {
  const char* name;
  std::function<void(Model&)> break_it;
  const char* element;
  const char* rule;  // a part of it
};

class InvalidModel : public testing::TestWithParam<Rule> {};

TEST_P(InvalidModel, is_refused_and_named) {
  Model model = two_joints();
  ASSERT_NO_THROW(model.validate());
  GetParam().break_it(model);
  try {
    model.validate();
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_EQ(error.element(), GetParam().element);
    EXPECT_NE(error.rule().find(GetParam().rule), std::string::npos) << error.what();
    EXPECT_FALSE(error.remedy().empty());
  }
}

const double nan = std::numeric_limits<double>::quiet_NaN();

INSTANTIATE_TEST_SUITE_P(
    model, InvalidModel,
    testing::Values(
        Rule{"twice", [](Model& m) { m.links[2].name = "upper"; }, "link 'upper'", "twice"},
        Rule{"nameless", [](Model& m) { m.joints[0].name = ""; }, "a joint", "no name"},
        Rule{"unknown_link", [](Model& m) { m.joints[0].parent = "bsae"; }, "joint 'shoulder'", "does not exist"},
        Rule{"loop", [](Model& m) { m.joints[1].parent = "lower"; }, "joint 'elbow'", "to itself"},
        Rule{"two_parents", [](Model& m) { m.joints[1].child = "upper", m.joints[1].parent = "base"; }, "link 'upper'",
             "child of two joints"},
        Rule{"apart",
             [](Model& m) {
               m.links.push_back({"alone", {}});
             },
             "model 'model'", "several links that no joint carries: 'base', 'alone'"},
        Rule{"no_root_of_its_own",
             [](Model& m) {
               m.links.push_back({"alone", {}});
               m.roots = {{"base"}};
             },
             "link 'alone'", "no root"},
        Rule{"unknown_root", [](Model& m) { m.roots = {{"bse"}}; }, "root 'bse'", "no link"},
        Rule{"root_twice",
             [](Model& m) {
               m.roots = {{"base"}, {"base"}};
             },
             "root 'base'", "twice"},
        Rule{"carried_root",
             [](Model& m) {
               m.roots = {{"base"}, {"upper", true}};
             },
             "root 'upper'", "carried by joint"},
        Rule{"circle", [](Model& m) { m.joints[0].parent = "lower"; }, "link 'upper'", "circle of joints"},
        Rule{"bolted_with_velocity",
             [](Model& m) {
               m.roots = {{"base"}};
               m.roots[0].velocity[2] = 1.0;
             },
             "root 'base'", "bolted, but has a velocity"},
        Rule{"massless", [](Model& m) { m.links[2].inertia = {}; }, "link 'lower'", "no mass"},
        Rule{"no_inertia_about_axis",
             [](Model& m) {
               m.links[2].inertia = {1.0, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
             },
             "link 'lower'", "no inertia about the axis"},
        Rule{"triangle", [](Model& m) { m.links[1].inertia.about_center(0, 0) = 1.0; }, "link 'upper'", "impossible"},
        Rule{"negative_moment", [](Model& m) { m.links[1].inertia.about_center(0, 0) = -1.0; }, "link 'upper'",
             "impossible"},
        Rule{"asymmetric", [](Model& m) { m.links[1].inertia.about_center(0, 1) = 1e-5; }, "link 'upper'", "symmetric"},
        Rule{"negative_mass", [](Model& m) { m.links[1].inertia.mass = -1; }, "link 'upper'", "negative"},
        Rule{"share_of_gravity", [](Model& m) { m.links[1].gravity = nan; }, "link 'upper'", "share of gravity"},
        Rule{"floating_massless_root",
             [](Model& m) {
               m.roots = {{m.links[0].name, true}};
             },
             "link 'base'", "floats"},
        Rule{"axis", [](Model& m) { m.joints[0].axis.setZero(); }, "joint 'shoulder'", "axis"},
        Rule{"no_rotation", [](Model& m) { m.joints[0].origin.linear() *= 2; }, "joint 'shoulder'", "no rotation"},
        Rule{"damping", [](Model& m) { m.joints[0].damping = -1; }, "joint 'shoulder'", "damping"},
        Rule{"nan_gain", [](Model& m) { m.joints[0].drive.kp = nan; }, "joint 'shoulder'", "finite"},
        Rule{"range", [](Model& m) { m.joints[0].lower = 1, m.joints[0].upper = 0; }, "joint 'shoulder'", "range"},
        Rule{"nan_offset", [](Model& m) { m.couplings[0].offset = nan; }, "coupling 'elbow'", "gamma"},
        Rule{"zero_ratio", [](Model& m) { m.couplings[0].terms[0].ratio = 0; }, "coupling 'elbow'", "is 0"},
        Rule{"huge_ratio", [](Model& m) { m.couplings[0].terms[0].ratio = 1e20; }, "coupling 'elbow'", "beyond"},
        Rule{"self", [](Model& m) { m.couplings[0].terms[0].joint = "elbow"; }, "coupling 'elbow'", "twice"},
        Rule{"unknown_joint", [](Model& m) { m.couplings[0].terms[0].joint = "knee"; }, "coupling 'elbow'",
             "does not exist"},
        Rule{"lonely", [](Model& m) { m.couplings[0].terms.clear(); }, "coupling 'elbow'", "only one joint"},
        Rule{"fixed_joint", [](Model& m) { m.joints[0].kind = JointKind::fixed; }, "coupling 'elbow'", "fixed"},
        Rule{"erp", [](Model& m) { m.couplings[0].softness = Hard{2.0}; }, "coupling 'elbow'", "erp"},
        Rule{"cfm",
             [](Model& m) {
               m.couplings[0].softness = ErpCfm{0.2, -1};
             },
             "coupling 'elbow'", "cfm"},
        Rule{"site", [](Model& m) { m.sites[0].link = "hand"; }, "link 'hand'", "no such link"},
        Rule{"gravity", [](Model& m) { m.gravity[1] = nan; }, "model 'model'", "gravity"},
        Rule{"time_step", [](Model& m) { m.time_step = -0.001; }, "model 'model'", "time step"},
        Rule{"time_step_nan", [](Model& m) { m.time_step = nan; }, "model 'model'", "time step"},
        Rule{"pose_without_name", [](Model& m) { m.poses = {{}}; }, "a pose", "no name"},
        Rule{"pose_twice", [](Model& m) { m.poses = {{"home"}, {"home"}}; }, "pose 'home'", "twice"},
        Rule{"pose_of_no_joint", [](Model& m) { m.poses = {{"home", {{"wrist", 0.1}}}}; }, "pose 'home'",
             "position of joint 'wrist'"},
        Rule{"pose_of_fixed",
             [](Model& m) {
               m.joints[1].kind = JointKind::fixed, m.couplings.clear();
               m.poses = {{"home", {{"elbow", 0.1}}}};
             },
             "pose 'home'", "fixed"},
        Rule{"pose_nan", [](Model& m) { m.poses = {{"home", {{"elbow", nan}}}}; }, "pose 'home'", "joint 'elbow'"},
        Rule{"pose_velocity", [](Model& m) { m.poses = {{"home", {}, {{"elbow", infinity}}}}; }, "pose 'home'",
             "velocity of joint 'elbow'"},
        Rule{"pose_target", [](Model& m) { m.poses = {{"home", {}, {}, {{"wrist", 1.0}}}}; }, "pose 'home'",
             "position target of joint 'wrist'"},
        Rule{"pose_of_bolted_root",
             [](Model& m) {
               m.roots = {{"base"}};
               m.poses = {{"home"}};
               m.poses[0].root_poses["base"] = Pose::Identity();
             },
             "pose 'home'", "bolted"},
        Rule{"pose_of_no_root",
             [](Model& m) {
               m.poses = {{"home"}};
               m.poses[0].root_velocities["lower"] = Twist::Zero();
             },
             "pose 'home'", "no root"},
        Rule{"pose_without_rotation",
             [](Model& m) {
               m.links[0].inertia = m.links[1].inertia;
               m.roots = {{"base", true}};
               m.poses = {{"home"}};
               m.poses[0].root_poses["base"] = Pose::Identity();
               m.poses[0].root_poses["base"].linear().setZero();
             },
             "pose 'home'", "root 'base'"}),
    [](const auto& rule) { return std::string(rule.param.name); });

// A moving link without mass is valid if a link that is fixed to it has mass.
TEST(Model, counts_the_inertia_of_links_that_are_fixed_to_a_moving_one) {
  Model model = two_joints();
  model.links.push_back({"tool", model.links[2].inertia});
  model.links[2].inertia = {};
  Joint weld;
  weld.name = "weld", weld.parent = "lower", weld.child = "tool";
  model.joints.push_back(weld);
  EXPECT_NO_THROW(model.validate());
}

TEST(EndColliders, are_on_bodies_that_move_and_carry_no_other_moving_body) {
  Model model = two_joints();
  for (const char* link : {"tool", "mount", "ball", "hand"}) model.links.push_back({link, model.links[2].inertia});
  const auto join = [&](const char* name, JointKind kind, const char* parent, const char* child) {
    Joint joint;
    joint.name = name, joint.kind = kind, joint.parent = parent, joint.child = child;
    model.joints.push_back(joint);
  };
  join("weld", JointKind::fixed, "lower", "tool"), join("bolt", JointKind::fixed, "base", "mount");
  join("wrist", JointKind::fixed, "tool", "hand"), join("sum", JointKind::tendon, "", "");
  model.couplings.push_back({"sum", {{"shoulder", -1.0}, {"elbow", -1.0}}, 0.0, Hard{}});
  model.roots = {{"base"}, {"ball", true}};
  for (const char* link : {"", "base", "mount", "upper", "lower", "tool", "ball", "hand"})
    model.colliders.push_back({.name = std::string("on ") + link, .link = link, .shape = Shape::sphere(0.1)});
  ASSERT_NO_THROW(model.validate());
  using Names = std::vector<std::string>;
  EXPECT_EQ(model.end_colliders(), (Names{"on lower", "on tool", "on ball", "on hand"}));
  model.joints[4].kind = JointKind::revolute;
  EXPECT_EQ(model.end_colliders(), (Names{"on ball", "on hand"}));
  model.colliders[3].link = "uper";
  EXPECT_THROW(model.end_colliders(), ModelError);
  model.colliders.clear();
  EXPECT_TRUE(model.end_colliders().empty());
}

TEST(CouplingNames, differ_for_couplings_of_the_same_first_joint) {
  Model model = two_joints();
  model.couplings.push_back(Coupling::mimic("elbow", "shoulder", -1.0));
  EXPECT_EQ(coupling_names(model), (std::vector<std::string>{"elbow", "elbow#2"}));
}

TEST(Sites, are_added_to_links_that_are_there_by_names_of_their_own) {
  Model model = two_joints();
  model.sites.clear();
  Pose pose = Pose::Identity();
  pose.translation().x() = 0.1;
  EXPECT_EQ(model.add_site("tip", model.links.back().name, pose).pose.translation().x(), 0.1);
  model.add_site("palm", model.links[1].name);
  EXPECT_EQ(model.site_index("palm"), 1);
  EXPECT_NO_THROW(model.validate());
  EXPECT_THROW(model.add_site("tip", model.links[1].name), ModelError);
  EXPECT_THROW(model.add_site("", model.links[1].name), ModelError);
  EXPECT_THROW(model.add_site("other", "nowhere"), ModelError);
  EXPECT_EQ(model.sites.size(), 2u);
}

}  // namespace
}  // namespace lockstep
