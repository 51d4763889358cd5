// The rules of Model::validate about bounds and kinematic drives. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "lockstep/error.h"
#include "lockstep/model.h"

namespace lockstep {
namespace {

const double nan = std::numeric_limits<double>::quiet_NaN();

// A finger of two joints; the second follows the first.
Model finger() {
  Model model;
  const Inertia box = Inertia::box(0.2, {0.1, 0.04, 0.04}, {0.05, 0, 0});
  model.links = {{"palm", {}}, {"near", box}, {"far", box}};
  Joint knuckle;
  knuckle.name = "knuckle", knuckle.kind = JointKind::revolute;
  knuckle.parent = "palm", knuckle.child = "near";
  Joint tip = knuckle;
  tip.name = "tip", tip.parent = "near", tip.child = "far";
  model.joints = {knuckle, tip};
  model.couplings = {Coupling::mimic("tip", "knuckle", -1.0)};
  return model;
}

struct Rule {
  const char* name;
  std::function<void(Joint&)> break_it;  // in the first joint
  const char* rule;                      // a part of it
  const char* remedy;                    // a part of it
};

void PrintTo(const Rule& rule, std::ostream* stream) { *stream << rule.name; }

void expect_refused(const Model& model, const std::string& element, const std::string& rule,
                    const std::string& remedy) {
  try {
    model.validate();
    FAIL() << "accepted";
  } catch (const ModelError& error) {
    EXPECT_EQ(error.element(), element) << error.what();
    EXPECT_NE(error.rule().find(rule), std::string::npos) << error.what();
    EXPECT_NE(error.remedy().find(remedy), std::string::npos) << error.what();
  }
}

class InvalidBound : public testing::TestWithParam<Rule> {};

TEST_P(InvalidBound, is_refused_and_named) {
  Model model = finger();
  ASSERT_NO_THROW(model.validate());
  GetParam().break_it(model.joints[0]);
  expect_refused(model, "joint 'knuckle'", GetParam().rule, GetParam().remedy);
}

// A kinematic drive, hard by default.
Drive kinematic(Softness softness = Hard{1.0}) {
  Drive drive;
  drive.kinematic = true, drive.softness = softness;
  return drive;
}

INSTANTIATE_TEST_SUITE_P(
    limits, InvalidBound,
    testing::Values(
        Rule{"lower_is_nan", [](Joint& j) { j.lower = nan; }, "NaN", "give a number"},
        Rule{"upper_is_nan", [](Joint& j) { j.upper = nan; }, "NaN", "give a number"},
        Rule{"swapped", [](Joint& j) { j.lower = 1, j.upper = 0; }, "empty", "swap"},
        Rule{"swapped_infinities", [](Joint& j) { j.lower = infinity, j.upper = -infinity; }, "empty", "swap"},
        Rule{"above_everything", [](Joint& j) { j.lower = infinity; }, "at infinity", "lower = -infinity"},
        Rule{"below_everything", [](Joint& j) { j.upper = -infinity; }, "at infinity", "upper = infinity"},
        Rule{"continuous_with_lower", [](Joint& j) { j.kind = JointKind::continuous, j.lower = -1; }, "continuous",
             "revolute"},
        Rule{"continuous_with_upper", [](Joint& j) { j.kind = JointKind::continuous, j.upper = 1; }, "continuous",
             "revolute"},
        Rule{"limit_erp", [](Joint& j) { j.limit_softness = Hard{2.0}; }, "erp of a hard limit", "give 0.2"},
        Rule{"limit_erp_of_erp_cfm",
             [](Joint& j) {
               j.limit_softness = ErpCfm{1.5, 0.1};
             },
             "erp of the limit is outside", "share"},
        Rule{"limit_cfm",
             [](Joint& j) {
               j.limit_softness = ErpCfm{0.2, -1};
             },
             "cfm of the limit", "give 0 (hard) or more"},
        Rule{"limit_spring",
             [](Joint& j) {
               j.limit_softness = Spring{-1, 0};
             },
             "soft limit is negative", "0 or more"},
        Rule{"limit_frequency",
             [](Joint& j) {
               j.limit_softness = Frequency{9, -1};
             },
             "damping ratio of the limit", "rad/s"},
        Rule{"limit_nan",
             [](Joint& j) {
               j.limit_softness = Spring{1, nan};
             },
             "softness of the limit", "finite"},
        Rule{"limit_infinite",
             [](Joint& j) {
               j.limit_softness = Spring{infinity, 1};
             },
             "softness of the limit", "finite"},
        Rule{"limit_without_strength",
             [](Joint& j) {
               j.limit_softness = Spring{0, 0};
             },
             "neither stiffness nor damping", "remove the position range"},
        Rule{"limit_without_frequency",
             [](Joint& j) {
               j.limit_softness = Frequency{0, 1};
             },
             "neither stiffness nor damping", "remove the position range"},
        Rule{"restitution_below_0", [](Joint& j) { j.restitution = -0.1; }, "restitution is -0.1", "share"},
        Rule{"restitution_above_1", [](Joint& j) { j.restitution = 1.1; }, "restitution is 1.1", "share"},
        Rule{"restitution_is_nan", [](Joint& j) { j.restitution = nan; }, "restitution is", "share"},
        Rule{"restitution_of_soft",
             [](Joint& j) {
               j.restitution = 0.5, j.limit_softness = Spring{9, 1};
             },
             "soft limits", "set it to 0"},
        Rule{"velocity_0", [](Joint& j) { j.velocity_limit = 0; }, "locks", "fixed or its drive kinematic"},
        Rule{"velocity_negative", [](Joint& j) { j.velocity_limit = -1; }, "velocity limit is negative", "more than 0"},
        Rule{"velocity_is_nan", [](Joint& j) { j.velocity_limit = nan; }, "velocity limit is", "more than 0"},
        Rule{"effort_negative", [](Joint& j) { j.effort_limit = -1; }, "effort limit is negative", "0 or more"},
        Rule{"effort_is_nan", [](Joint& j) { j.effort_limit = nan; }, "effort limit is", "0 or more"},
        Rule{"friction_negative", [](Joint& j) { j.friction = -1; }, "friction is negative", "0 or more"},
        Rule{"friction_infinite", [](Joint& j) { j.friction = infinity; }, "friction is not", "finite"}),
    [](const auto& rule) { return std::string(rule.param.name); });

INSTANTIATE_TEST_SUITE_P(
    drives, InvalidBound,
    testing::Values(
        Rule{"kinematic_with_kp", [](Joint& j) { j.drive = kinematic(), j.drive.kp = 1; }, "kp or kd", "servo"},
        Rule{"kinematic_with_kd", [](Joint& j) { j.drive = kinematic(), j.drive.kd = 1; }, "kp or kd", "servo"},
        Rule{"servo_kd", [](Joint& j) { j.drive.kd = -1; }, "drive kd is negative", "0 or more"},
        Rule{"servo_softer", [](Joint& j) { j.drive.softness = Hard{0.5}; }, "only kinematic ones have",
             "make the drive kinematic"},
        Rule{"servo_of_other_kind",
             [](Joint& j) {
               j.drive.softness = ErpCfm{1.0, 0.0};
             },
             "only kinematic ones have", "make the drive kinematic"},
        Rule{"kinematic_erp_0", [](Joint& j) { j.drive = kinematic(Hard{0}); }, "outside (0, 1]", "give 1"},
        Rule{"kinematic_erp_above_1", [](Joint& j) { j.drive = kinematic(Hard{1.5}); }, "outside (0, 1]", "give 1"},
        Rule{"kinematic_erp_0_of_erp_cfm",
             [](Joint& j) {
               j.drive = kinematic(ErpCfm{0, 0});
             },
             "outside (0, 1]", "give 1"},
        Rule{"kinematic_cfm",
             [](Joint& j) {
               j.drive = kinematic(ErpCfm{1, -1});
             },
             "cfm of the kinematic drive", "or more"},
        Rule{"kinematic_without_strength",
             [](Joint& j) {
               j.drive = kinematic(Spring{0, 0});
             },
             "neither stiffness nor damping", "not kinematic"}),
    [](const auto& rule) { return std::string(rule.param.name); });

TEST(Model, refuses_force_limits_that_are_not_positive) {
  for (const auto& [limit, rule, remedy] : {std::tuple(0.0, "force limit is 0", "coupling_switch"),
                                            {-1.0, "negative", "more than 0"},
                                            {nan, "NaN", "more than 0"}}) {
    Model model = finger();
    model.couplings[0].force_limit = limit;
    expect_refused(model, "coupling 'tip'", rule, remedy);
  }
}

// These are the ends of every range, and values that look odd but are valid.
TEST(Model, accepts_valid_bounds) {
  const std::function<void(Joint&)> changes[] = {[](Joint& j) { j.lower = 0.3, j.upper = 0.3; },
                                                 [](Joint& j) { j.lower = -1; },
                                                 [](Joint& j) { j.restitution = 1.0; },
                                                 [](Joint& j) {
                                                   j.restitution = 0.5, j.limit_softness = ErpCfm{0.2, 0.0};
                                                 },  // hard as well
                                                 [](Joint& j) { j.limit_softness = Hard{0.0}; },
                                                 [](Joint& j) {
                                                   j.limit_softness = Frequency{30, 0};
                                                 },
                                                 [](Joint& j) {
                                                   j.limit_softness = Spring{0, 2};
                                                 },
                                                 [](Joint& j) { j.velocity_limit = 1e-6; },
                                                 [](Joint& j) { j.effort_limit = 0.0; },
                                                 [](Joint& j) { j.friction = 5.0; },
                                                 [](Joint& j) { j.drive = kinematic(); },
                                                 [](Joint& j) { j.drive = kinematic(Hard{0.1}); },
                                                 [](Joint& j) {
                                                   j.drive = kinematic(Spring{0, 10});
                                                 },
                                                 [](Joint& j) {
                                                   j.drive = kinematic(ErpCfm{0.0, 0.1});
                                                 },
                                                 [](Joint& j) { j.drive.kp = 3, j.drive.kd = 1; }};
  int number = 0;
  for (const auto& change : changes) {
    SCOPED_TRACE(++number);
    Model model = finger();
    change(model.joints[0]);
    model.couplings[0].force_limit = 2.0;
    EXPECT_NO_THROW(model.validate());
  }
}

}  // namespace
}  // namespace lockstep
