// What compile() refuses and chooses, and what a Plan looks up. SPDX-License-Identifier: Apache-2.0
#include "lockstep/plan.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// ---------------------------------------------------------------- settings

struct Rule {
  const char* name;
  std::function<void(StepSettings&)> break_it;
  const char* setting;
};

class InvalidSetting : public testing::TestWithParam<Rule> {};

TEST_P(InvalidSetting, is_refused_and_named) {
  StepSettings settings;
  GetParam().break_it(settings);
  try {
    compile(scenes::chain8(), settings);
    FAIL() << "accepted";
  } catch (const SettingsError& error) {
    EXPECT_EQ(error.element(), GetParam().setting);
    EXPECT_FALSE(error.rule().empty());
    EXPECT_FALSE(error.remedy().empty());
  }
}

INSTANTIATE_TEST_SUITE_P(
    settings, InvalidSetting,
    testing::Values(
        Rule{"dt_zero", [](StepSettings& s) { s.dt = 0.0; }, "dt"},
        Rule{"dt_negative", [](StepSettings& s) { s.dt = -1e-3; }, "dt"},
        Rule{"dt_nan", [](StepSettings& s) { s.dt = nan; }, "dt"},
        Rule{"dt_infinite", [](StepSettings& s) { s.dt = infinity; }, "dt"},
        Rule{"no_iterations", [](StepSettings& s) { s.iterations = 0; }, "iterations"},
        Rule{"many_iterations", [](StepSettings& s) { s.iterations = 1001; }, "iterations"},
        Rule{"negative_velocity_iterations", [](StepSettings& s) { s.velocity_iterations = -1; },
             "velocity_iterations"},
        Rule{"many_velocity_iterations", [](StepSettings& s) { s.velocity_iterations = 1001; }, "velocity_iterations"},
        Rule{"no_position_bound", [](StepSettings& s) { s.position_bound = 0.0; }, "position_bound"},
        Rule{"nan_position_bound", [](StepSettings& s) { s.position_bound = nan; }, "position_bound"},
        Rule{"infinite_velocity_bound", [](StepSettings& s) { s.velocity_bound = infinity; }, "velocity_bound"},
        Rule{"negative_velocity_bound", [](StepSettings& s) { s.velocity_bound = -1.0; }, "velocity_bound"},
        Rule{"method_77", [](StepSettings& s) { s.method = Method(77); }, "method"},
        Rule{"method_negative", [](StepSettings& s) { s.method = Method(-1); }, "method"},
        Rule{"integrator_77", [](StepSettings& s) { s.integrator = Integrator(77); }, "integrator"},
        Rule{"parameter_unknown", [](StepSettings& s) { s.per_environment.insert(Parameter(parameter_count)); },
             "per_environment"},
        Rule{"parameter_77", [](StepSettings& s) { s.per_environment = {Parameter(77)}; }, "per_environment"},
        Rule{"unknown_ignored",
             [](StepSettings& s) {
               s.ignore.friction = {"j0", "nobody"};
             },
             "ignore"},
        Rule{"guard_of_zero", [](StepSettings& s) { s.guard = 0.0; }, "guard"}),
    [](const auto& rule) { return std::string(rule.param.name); });

TEST(Compile, accepts_settings_at_their_limits) {
  StepSettings settings;
  settings.method = Method::pgs;
  for (int iterations : {1, 1000})
    for (int velocity_iterations : {0, 1000}) {
      settings.iterations = iterations, settings.velocity_iterations = velocity_iterations;
      EXPECT_NO_THROW(compile(scenes::chain8(), settings));
    }
}

TEST(Compile, refuses_an_erp_above_1_that_the_sub_steps_of_tgs_share) {
  Model model = scenes::chain8();
  model.couplings[2].softness = Hard{1.5};
  StepSettings settings = {.method = Method::tgs};
  EXPECT_THROW(compile(model, settings), SettingsError);
  settings.iterations = 1;
  EXPECT_NO_THROW(compile(model, settings));
  EXPECT_NO_THROW(compile(model, {.method = Method::pgs}));
}

TEST(Compile, refuses_reduced_for_gear_ratios_per_environment_of_redundant_couplings) {
  EXPECT_THROW(compile(scenes::redundant(), {.method = Method::reduced, .per_environment = {Parameter::gear_ratio}}),
               SettingsError);
  EXPECT_NO_THROW(compile(scenes::chain8(), {.method = Method::reduced, .per_environment = {Parameter::gear_ratio}}));
  EXPECT_NO_THROW(compile(scenes::redundant(), {.method = Method::reduced}));
}

TEST(Compile, refuses_impossible_models) {
  Model model = scenes::chain8();
  model.links[3].inertia.mass = -1.0;
  EXPECT_THROW(compile(model), ModelError);
}

// ---------------------------------------------------------------- couplings

TEST(Compile, names_couplings_that_contradict_each_other) {
  Model model = scenes::redundant();  // (0,2), (2,4), (0,4)
  model.couplings[2].offset = 0.25;
  for (Method method : {Method::pgs, Method::tgs, Method::direct, Method::reduced}) {
    try {
      compile(model, {.method = method});
      FAIL() << to_string(method);
    } catch (const ModelError& error) {
      const std::vector<std::string> names = coupling_names(model);
      EXPECT_EQ(error.element(), "coupling '" + names[2] + "'");
      for (std::size_t other : {0, 1})
        EXPECT_NE(error.rule().find("'" + names[other] + "'"), std::string::npos) << error.what();
      EXPECT_NE(error.rule().find("0.25"), std::string::npos) << error.what();
    }
  }
  model.couplings[1].softness = Spring{10.0, 1.0};  // yields to the others
  EXPECT_NO_THROW(compile(model));
}

TEST(Plan, lists_redundant_couplings) {
  EXPECT_EQ(compile(scenes::redundant()).redundant_couplings(), std::vector<int>{2});
  EXPECT_TRUE(compile(scenes::chain8()).redundant_couplings().empty());
  Model twice = scenes::chain8();
  twice.couplings.push_back(scenes::chain8().couplings[0]);
  EXPECT_EQ(compile(twice).redundant_couplings(), std::vector<int>{4});
  twice.couplings[4].softness = Spring{10.0, 1.0};  // a spring is not redundant
  EXPECT_TRUE(compile(twice).redundant_couplings().empty());
}

TEST(Plan, lists_eliminated_dofs) {
  const Plan chain = compile(scenes::chain8(), {.method = Method::reduced});
  EXPECT_EQ(chain.eliminated_dofs(), (std::vector<int>{0, 1, 4, 5}));
  EXPECT_EQ(compile(scenes::gripper13()).eliminated_dofs(), (std::vector<int>{8, 9, 10, 11, 12}));
  EXPECT_TRUE(compile(scenes::chain8(), {.method = Method::direct}).eliminated_dofs().empty());
}

TEST(Plan, chooses_reduced_where_it_applies_and_direct_elsewhere) {
  EXPECT_EQ(compile(scenes::chain8()).method(), Method::reduced);
  EXPECT_EQ(compile(scenes::chain8(), {.per_environment = {Parameter::softness}}).method(), Method::direct);
  EXPECT_EQ(compile(scenes::redundant(), {.per_environment = {Parameter::gear_ratio}}).method(), Method::direct);
  Model model = scenes::chain8();
  for (Coupling& coupling : model.couplings) coupling.softness = Frequency{10.0, 1.0};
  EXPECT_EQ(compile(model).method(), Method::direct);
  model.couplings[0].softness = Hard{};
  EXPECT_EQ(compile(model).method(), Method::reduced);
  model.couplings.clear();
  EXPECT_EQ(compile(model).method(), Method::reduced);
  for (Method method : {Method::pgs, Method::tgs, Method::direct})
    EXPECT_EQ(compile(model, {.method = method}).method(), method);
}

TEST(Plan, lists_what_stands_in_the_way_of_what) {
  const auto names = [](const Model& model, const StepSettings& settings, const char* applies_to, const char* feature) {
    for (const Obstacle& obstacle : compile(model, settings).obstacles())
      if (obstacle.applies_to == applies_to && obstacle.feature == feature) return !obstacle.reason.empty();
    return false;
  };
  Model model = scenes::chain8();
  EXPECT_TRUE(compile(model).obstacles().empty());
  EXPECT_TRUE(names(model, {.guard = infinity}, "audit", "guard"));
  EXPECT_TRUE(names(model, {.method = Method::pgs}, "leapfrog", "sweeps"));
  EXPECT_TRUE(names(model, {.velocity_iterations = 0}, "leapfrog", "velocity_iterations"));
  EXPECT_TRUE(names(scenes::redundant(), {.per_environment = {Parameter::gear_ratio}}, "reduced",
                    "gear ratios per environment"));
  model.couplings[2].softness = Hard{1.9};
  EXPECT_TRUE(names(model, {}, "tgs", "high erp"));
  EXPECT_FALSE(names(model, {.iterations = 1}, "tgs", "high erp"));
  EXPECT_TRUE(names(model, {}, "extrapolated", "high erp"));
  model.couplings[2].softness = Spring{10.0, 1.0};
  EXPECT_TRUE(names(model, {}, "folding", "stages"));
  model.joints[0].lower = -1.0;
  EXPECT_TRUE(names(model, {}, "stages", "kept couplings"));
}

TEST(Plan, looks_names_up_and_refuses_unknown_ones) {
  const Model model = scenes::random_model(3);
  const Plan plan = compile(model);
  for (int dof = 0; dof < plan.dofs(); ++dof) EXPECT_EQ(plan.dof(plan.dof_names()[static_cast<std::size_t>(dof)]), dof);
  for (std::size_t l = 0; l < model.links.size(); ++l) EXPECT_EQ(plan.link(model.links[l].name), static_cast<int>(l));
  EXPECT_EQ(plan.site("site1"), 1);
  EXPECT_EQ(plan.root_names().size(), model.roots[0].floating ? 1u : 0u);
  EXPECT_EQ(plan.couplings(), static_cast<int>(model.couplings.size()));
  EXPECT_THROW(plan.dof("elbow"), UsageError);
  EXPECT_THROW(plan.link("elbow"), UsageError);
  EXPECT_THROW(plan.site("elbow"), UsageError);
  Model welded = scenes::chain8();
  welded.links.push_back({"tool", {}});
  Joint weld;
  weld.name = "weld", weld.parent = "l7", weld.child = "tool";
  welded.joints.push_back(weld);
  EXPECT_THROW(compile(welded).dof("weld"), UsageError) << "a fixed joint is no dof";
  EXPECT_EQ(compile(welded).link("tool"), 9);
}

TEST(Plan, is_shared_by_its_copies) {
  const Plan plan = compile(scenes::chain8());
  const Plan copy = plan;
  EXPECT_EQ(&copy.model(), &plan.model());
  EXPECT_EQ(&program_of(copy), &program_of(plan));
}

TEST(ToString, names_methods_and_parameters) {
  EXPECT_STREQ(to_string(Method::automatic), "automatic");
  EXPECT_STREQ(to_string(Method::pgs), "pgs");
  EXPECT_STREQ(to_string(Method::tgs), "tgs");
  EXPECT_STREQ(to_string(Method::direct), "direct");
  EXPECT_STREQ(to_string(Method::reduced), "reduced");
  const char* parameters[parameter_count] = {
      "gear_ratio",      "offset",         "softness",           "drive_gains",    "damping",   "mass",
      "gravity",         "link_wrench",    "coupling_switch",    "armature",       "stiffness", "friction",
      "position_limits", "velocity_limit", "effort_limit",       "center_of_mass", "inertia",   "contact_friction",
      "loop_switch",     "loop_frame",     "function",           "drive_delay",    "drive_lag", "motor_curve",
      "collider_place",  "collider_size",  "contact_restitution"};
  for (unsigned p = 0; p < parameter_count; ++p) EXPECT_STREQ(to_string(static_cast<Parameter>(p)), parameters[p]);
}

}  // namespace
}  // namespace lockstep
