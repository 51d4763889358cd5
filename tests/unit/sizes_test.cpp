// Large mechanisms: they compile, or are refused before their matrices are made. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "lockstep/lockstep.h"

namespace lockstep {
namespace {

constexpr int nobody = -1;

// Link i hangs on the link of parent(i), or on the base. Joint i has a coupling if it follows one.
Model mechanism(
    int joints, bool limits, const std::function<int(int)>& parent,
    const std::function<int(int)>& leader = [](int) { return nobody; }) {
  Model model;
  model.name = "large";
  model.links.push_back({"base", {}});
  for (int i = 0; i < joints; ++i) {
    const std::string number = std::to_string(i);
    model.links.push_back({"l" + number, Inertia::box(0.2, {0.1, 0.04, 0.04}, {0.05, 0.0, 0.0})});
    Joint joint;
    joint.name = "j" + number;
    joint.kind = JointKind::revolute;
    joint.parent = parent(i) == nobody ? "base" : "l" + std::to_string(parent(i));
    joint.child = "l" + number;
    joint.origin.translation() = Eigen::Vector3d(0.1, 0.0, 0.0);
    joint.axis = Eigen::Vector3d::UnitY();
    if (limits) joint.lower = -1.0, joint.upper = 1.0;
    model.joints.push_back(joint);
    if (leader(i) == nobody) continue;
    Coupling coupling;
    coupling.joint = joint.name;
    coupling.terms = {{"j" + std::to_string(leader(i)), -1.0}};
    model.couplings.push_back(coupling);
  }
  return model;
}

int on_base(int) { return nobody; }
int on_the_one_before(int i) { return i - 1; }
int the_one_before(int i) { return i - 1; }
int the_first(int i) { return i > 0 ? 0 : nobody; }

std::string refusal_of(const Model& model) {
  try {
    compile(model, {});
  } catch (const ModelError& error) {
    EXPECT_STREQ(error.code(), "model.whole");
    return error.what();
  }
  return "none";
}

TEST(Sizes, plain_chains_need_no_matrix) {
  const Plan plan = compile(mechanism(20000, false, on_the_one_before), {});
  EXPECT_EQ(plan.dofs(), 20000);
}

TEST(Sizes, chains_with_limits_compile_up_to_the_room_of_a_matrix) {
  EXPECT_EQ(compile(mechanism(1000, true, on_the_one_before), {}).row_names().size(), 1000u);
  EXPECT_NE(refusal_of(mechanism(20000, true, on_the_one_before)).find("more than 2097152"), std::string::npos);
}

TEST(Sizes, refusals_name_the_matrix_its_entries_and_its_memory) {
  StepSettings settings;
  settings.method = Method::pgs;
  try {
    compile(mechanism(3000, false, on_base, the_one_before), settings);
    FAIL() << "is not refused";
  } catch (const ModelError& error) {
    EXPECT_EQ(error.element(), "model 'large'");
    EXPECT_EQ(
        error.rule(),
        "is too large: the matrix K of its rows would have at least 8994001 entries, more than 2097152. In single "
        "precision they take 35 MB for each environment, in double 71 MB");
    EXPECT_NE(error.remedy().find("split the mechanism"), std::string::npos);
  }
}

TEST(Sizes, many_small_trees_compile) {
  const auto gripper = [](int i) { return i % 3 == 0 ? nobody : i - i % 3; };
  const auto fingers = [](int i) { return i % 3 == 2 ? i - 1 : nobody; };
  const Plan plan = compile(mechanism(6000, true, gripper, fingers), {});
  EXPECT_EQ(plan.follower_dofs().size(), 2000u);
  EXPECT_NE(plan.describe().find("6000 moving joints, 2000 couplings"), std::string::npos);
}

TEST(Sizes, many_followers_of_one_leader_compile) {
  const Plan plan = compile(mechanism(4000, true, on_base, the_first), {});
  EXPECT_EQ(plan.independent_dofs(), std::vector<int>{0});
}

TEST(Sizes, chains_of_followers_compile_up_to_the_room_of_their_elimination) {
  EXPECT_EQ(compile(mechanism(1000, false, on_base, the_one_before), {}).eliminated_dofs().size(), 999u);
  EXPECT_NE(refusal_of(mechanism(20000, false, on_base, the_one_before)).find("the elimination of its followers"),
            std::string::npos);
}

}  // namespace
}  // namespace lockstep
