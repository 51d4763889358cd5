// Which dofs couplings leave free, and which they lock. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>

#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

// Revolute joints a, b, c ... on one base.
Model wheels(int count) {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < count; ++i) {
    Joint joint;
    joint.name = joint.child = std::string(1, static_cast<char>('a' + i));
    joint.parent = "base", joint.kind = JointKind::continuous;
    model.links.push_back({joint.child, Inertia::box(1.0, {0.1, 0.2, 0.3}, Eigen::Vector3d::Zero())});
    model.joints.push_back(joint);
  }
  return model;
}

TEST(Followers, do_not_depend_on_softness_or_method) {
  Model model = wheels(5);
  model.couplings = {Coupling::mimic("c", "b", 2.0, 0.5), Coupling::mimic("b", "a", -1.5, 0.25)};
  Model soft = model;
  for (Coupling& coupling : soft.couplings) coupling.softness = Spring{10.0, 1.0};
  std::vector<Plan> plans = {compile(soft), compile(model, {.per_environment = {Parameter::softness}}),
                             compile(model, {.per_environment = {Parameter::coupling_switch}})};
  for (const Method method : {Method::automatic, Method::pgs, Method::tgs, Method::direct, Method::reduced})
    plans.push_back(compile(model, {.method = method}));
  for (const Plan& plan : plans) {
    EXPECT_EQ(plan.independent_dofs(), (std::vector{0, 3, 4}));
    EXPECT_EQ(plan.follower_dofs(), (std::vector{1, 2}));  // c follows b, so b comes first
    EXPECT_EQ(plan.leader(0), -1);
    EXPECT_EQ(plan.leader(1), 0);
    EXPECT_EQ(plan.leader(2), 0);
    EXPECT_EQ(plan.leader(4), -1);
  }
  // b = 1.5 a - 0.25 and c = -2 b - 0.5 = -3 a.
  const Following& c = plans[0].following(2);
  ASSERT_EQ(c.leaders.size(), 1u);
  EXPECT_DOUBLE_EQ(c.leaders[0].ratio, -3.0);
  EXPECT_NEAR(c.offset, 0.0, 1e-16);
  EXPECT_DOUBLE_EQ(plans[0].following(1).offset, -0.25);
  EXPECT_THROW(plans[0].following(5), UsageError);
  EXPECT_THROW(plans[0].leader(-1), UsageError);
}

TEST(Followers, of_several_leaders_have_no_single_one) {
  Model model = wheels(3);
  model.couplings = {{"a", {{"b", 2.0}, {"c", -1.0}}, 0.0, {}, infinity}};
  const Plan plan = compile(model);
  EXPECT_EQ(plan.independent_dofs(), (std::vector{1, 2}));
  EXPECT_EQ(plan.leader(0), -1);
  ASSERT_EQ(plan.following(0).leaders.size(), 2u);
  EXPECT_EQ(plan.following(0).leaders[0].dof, 1);
  EXPECT_DOUBLE_EQ(plan.following(0).leaders[0].ratio, -2.0);
}

TEST(Followers, are_those_that_reduced_eliminates) {
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    scenes::RandomOptions options;
    options.soft = scenes::RandomOptions::Soft::never;
    const Plan plan = compile(scenes::random_model(seed, options));
    std::vector<int> followers = plan.follower_dofs(), eliminated = plan.eliminated_dofs(),
                     all = plan.independent_dofs();
    std::sort(followers.begin(), followers.end());
    std::sort(eliminated.begin(), eliminated.end());
    if (plan.method() == Method::reduced) {
      EXPECT_EQ(followers, eliminated) << seed;
    }
    all.insert(all.end(), followers.begin(), followers.end());
    std::sort(all.begin(), all.end());
    for (int dof = 0; dof < plan.dofs(); ++dof) EXPECT_EQ(all.at(dof), dof) << seed;
  }
}

TEST(LockedJoints, are_named_with_the_couplings_that_lock_them) {
  Model model = wheels(5);  // b = a and b = -a lock both; d = 2 c and e = d move
  model.couplings = {Coupling::mimic("b", "a", -1.0), Coupling::mimic("d", "c", -2.0), Coupling::mimic("b", "a", 1.0),
                     Coupling::mimic("e", "d", -1.0)};
  const Plan plan = compile(model);
  ASSERT_EQ(plan.locked_joints().size(), 1u);
  EXPECT_EQ(plan.locked_joints()[0].dofs, (std::vector{0, 1}));
  EXPECT_EQ(plan.locked_joints()[0].couplings, (std::vector{0, 2}));
  EXPECT_NE(plan.describe().find("a, b cannot move: couplings b, b#2 leave one position."), std::string::npos)
      << plan.describe();
  EXPECT_EQ(plan.independent_dofs(), (std::vector{2}));
  EXPECT_EQ(plan.leader(0), -1);

  model.couplings[2].softness = Spring{10.0, 1.0};  // a spring gives way
  EXPECT_TRUE(compile(model).locked_joints().empty());
  EXPECT_EQ(compile(model).independent_dofs(), (std::vector{2}));
  model.couplings[2] = Coupling::mimic("b", "a", -1.0);  // redundant, which locks nothing
  EXPECT_TRUE(compile(model).locked_joints().empty());
}

TEST(IgnoredBounds, are_chosen_by_joint) {
  Model model = wheels(3);
  for (Joint& joint : model.joints) {
    joint.kind = JointKind::revolute;
    joint.lower = -1.0, joint.upper = 1.0, joint.velocity_limit = 2.0, joint.effort_limit = 3.0, joint.friction = 0.1;
    joint.drive.kp = 1.0;
  }
  model.couplings = {Coupling::mimic("b", "a", -1.0)};
  const auto rows = [&](const Ignored& ignore) { return compile(model, {.ignore = ignore}).row_names(); };
  const std::vector<std::string> all = rows({});
  const auto without = [&](std::vector<std::string> left_out) {
    std::vector<std::string> names = all;
    for (const std::string& name : left_out) std::erase(names, name);
    EXPECT_EQ(names.size(), all.size() - left_out.size());
    return names;
  };
  EXPECT_EQ(rows({.position_limits = {"c"}}), without({"position limit c"}));
  EXPECT_EQ(rows({.position_limits = JointSet::of_followers()}), without({"position limit b"}));
  EXPECT_EQ(rows({.velocity_limits = {"a", "b"}, .friction = JointSet::of_followers()}),
            without({"velocity limit a", "velocity limit b", "friction b"}));
  EXPECT_EQ(rows({.effort_limits = {"a"}}), without({"effort limit a"}));
  EXPECT_EQ(rows({.effort_limits = true}), without({"effort limit a", "effort limit b", "effort limit c"}));
  EXPECT_NE(compile(model, {.ignore = {.position_limits = {"c"}}})
                .describe()
                .find("Left out by StepSettings::ignore: 1 position range."),
            std::string::npos);
}

}  // namespace
}  // namespace lockstep
