// What a Plan says of itself: its description and what a step costs. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

// ---------------------------------------------------------------- describe()

void expect_said(const Plan& plan, std::initializer_list<const char*> parts) {
  const std::string text = plan.describe();
  for (const char* part : parts) EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in\n" << text;
}

void expect_unsaid(const Plan& plan, std::initializer_list<const char*> parts) {
  const std::string text = plan.describe();
  for (const char* part : parts) EXPECT_EQ(text.find(part), std::string::npos) << "'" << part << "' in\n" << text;
}

TEST(Description, names_the_method_its_reason_and_what_it_costs) {
  const Plan plan = compile(scenes::gripper13());
  expect_said(plan, {"gripper13: fixed base, 13 moving joints, 5 couplings", "Method: reduced (hard couplings",
                     "Integrator: leapfrog", "dt 0.00416667 s (240 Hz)", "eliminated: j8, j9, j10, j11, j12"});
  expect_said(plan, {(std::to_string(plan.flops_per_step()) + " flops").c_str(),
                     (std::to_string(plan.bytes_per_step(4)) + " bytes").c_str(),
                     (std::to_string(plan.bytes_per_step(8)) + " in f64").c_str()});
  expect_said(compile(scenes::gripper13(), {.method = Method::tgs}),
              {"Method: tgs (as asked for)", "5 rows, 4 sub-steps of one sweep, then 1 velocity iteration"});
  expect_said(compile(scenes::gripper13(), {.method = Method::pgs}),
              {"Method: pgs (as asked for)", "5 rows, 4 sweeps"});
  expect_said(compile(scenes::chain8(), {.per_environment = {Parameter::softness}}),
              {"Method: direct (the softness differs per environment", "4 rows are solved together"});
}

// (M77): where A is made, and couplings have joints of their own.
TEST(Description, tells_whether_speeds_of_couplings_are_solved_for) {
  const char* const speeds = "speeds of couplings for velocities";
  StepSettings settings{.method = Method::pgs, .integrator = Integrator::euler};
  expect_said(compile(scenes::chain8(), settings), {speeds, "responses, row terms, pgs"});
  expect_unsaid(compile(scenes::chain32(), settings), {speeds});  // articulated bodies are less work
  expect_unsaid(compile(scenes::gear100(), settings), {speeds});  // elimination would leave next to nothing
  settings.method = Method::direct;
  expect_said(compile(scenes::chain8(), settings),
              {speeds, "4 rows are met by prescribed speeds.", "prescribed speeds of couplings"});
  Model limited = scenes::chain8();
  limited.joints[0].lower = -1.0;
  expect_said(compile(limited, settings), {"met by prescribed speeds, solved together by L^T D L where bounds act"});
  settings.record_impulses = true;
  expect_said(compile(scenes::chain8(), settings),
              {speeds, "4 rows are solved together", "responses, row terms, direct"});
  settings.per_environment = {Parameter::gear_ratio};
  expect_unsaid(compile(scenes::chain8(), settings), {speeds});
  Model soft = scenes::chain8();
  for (Coupling& coupling : soft.couplings) coupling.softness = Spring{40.0, 1.0};
  expect_said(compile(soft, {.integrator = Integrator::euler}), {speeds, "responses, row terms, direct"});
}

TEST(Description, says_softness_in_words) {
  Model model = scenes::chain8();
  model.couplings[0].softness = Hard{0.25};
  model.couplings[1].softness = ErpCfm{0.5, 0.125};
  model.couplings[2].softness = Spring{80.0, 2.5};
  model.couplings[3].softness = Frequency{12.566370614359172, 0.7};
  expect_said(compile(model),
              {"hard (erp 0.25)", "erp 0.5, cfm 0.125", "kp 80, kd 2.5", "12.5664 rad/s (2 Hz), damping ratio 0.7"});
  model.couplings[2].softness = Spring{0.0, 0.0};
  expect_said(compile(model), {"absent: it has neither stiffness nor damping"});
  expect_said(compile(scenes::redundant()), {"redundant: it follows from those above"});
}

TEST(Description, lists_what_was_left_out) {
  const Plan bare = compile(scenes::chain8());
  expect_said(bare, {"Left out, as the scene has none:", "solver rows", "drives", "armature",
                     "gear_ratio per environment", "link_wrench per environment"});
  const Plan full = compile(scenes::gripper13(), {.method = Method::direct,
                                                  .per_environment = {Parameter::gear_ratio, Parameter::link_wrench}});
  expect_unsaid(full, {"solver rows", "drives,", "gear_ratio per environment", "link_wrench per environment"});
  expect_said(full, {"damping", "armature", "mass per environment"});
}

TEST(Description, tells_of_bounds_and_of_those_to_be_ignored) {
  Model model = scenes::chain8();
  expect_unsaid(compile(model), {"Bounds", "Ignored"});
  model.joints[0].lower = -1.0;
  model.joints[1].upper = 1.0;
  model.joints[2].velocity_limit = 3.0;
  model.joints[3].effort_limit = 5.0;
  model.joints[4].friction = 0.1;
  // j0 to j3 move with the velocities of j2 and j3, so their bounds are two rows; j4 goes with j6.
  expect_said(compile(model), {"Bounds: 2 position ranges, 1 velocity limit, 1 effort limit, 1 dry friction; 3 rows",
                               "solved exactly through the couplings"});
  expect_said(compile(model, {.method = Method::pgs}), {"4 rows", "swept after the couplings"});
  StepSettings some;
  some.ignore.friction = some.ignore.position_limits = true;
  expect_said(compile(model, some), {"Bounds: 1 velocity limit, 1 effort limit; 1 row",
                                     "Ignored, as asked for: 2 position ranges, 1 dry friction"});
}

// ---------------------------------------------------------------- cost

TEST(Flops, of_a_feature_that_a_scene_has_not_are_not_spent) {
  Model bare = scenes::chain8();
  bare.couplings.clear();
  for (Joint& joint : bare.joints) joint.damping = 0.0;
  const auto costs = [](const Model& model, StepSettings settings = {}) {
    settings.integrator = Integrator::euler;
    return compile(model, settings).flops_per_step();
  };
  const long none = costs(bare);
  EXPECT_GT(none, 8 * 100);
  EXPECT_LT(none, 8 * 1000);

  Model driven = bare;
  driven.joints[3].drive = {10.0, 1.0, 0.0, 0.0};
  EXPECT_GT(costs(driven), none);
  EXPECT_LT(costs(driven), none + 20) << "one drive, not eight";
  for (Method method : {Method::pgs, Method::tgs, Method::direct}) {
    Model coupled = bare;
    coupled.couplings = {scenes::chain8().couplings[0]};
    const long one = costs(coupled, {.method = method});
    if (method != Method::tgs) {  // which shares out the free motion over its sub-steps, couplings or not
      EXPECT_EQ(costs(bare, {.method = method}), none) << to_string(method) << " without couplings";
    }
    EXPECT_GT(one, none);
    EXPECT_GT(costs(scenes::chain8(), {.method = method}), one);
  }
  for (Parameter parameter :
       {Parameter::drive_gains, Parameter::damping, Parameter::mass, Parameter::gravity, Parameter::link_wrench})
    EXPECT_GT(costs(bare, {.per_environment = {parameter}}), none) << to_string(parameter);
  for (Parameter parameter :
       {Parameter::gear_ratio, Parameter::offset, Parameter::softness, Parameter::coupling_switch})
    EXPECT_EQ(costs(bare, {.method = Method::direct, .per_environment = {parameter}}), none)
        << to_string(parameter) << " of no couplings";
  Model limited = bare;
  for (Joint& joint : limited.joints) joint.lower = -1.0, joint.upper = 1.0;
  EXPECT_GT(costs(limited), none);
  EXPECT_LT(costs(limited), none + none / 10) << "limits that do not act";
  limited.joints[0].friction = limited.joints[0].effort_limit = limited.joints[0].velocity_limit = 0.5;
  StepSettings without;
  without.ignore = {true, true, true, true};
  EXPECT_EQ(costs(limited, without), none) << "what is ignored costs nothing";
}

// Of a step that takes the matrix once, twice the bias forces and four solves, and of what repeats that.
TEST(Flops, of_integrators_are_those_of_what_they_repeat) {
  const auto costs_of = [](const Model& model, Integrator integrator) {
    return static_cast<double>(compile(model, {.integrator = integrator}).flops_per_step());
  };
  // On chain8 both make A_r by entries; on chain32 euler takes a shorter way, which leapfrog cannot.
  const double one = costs_of(scenes::chain8(), Integrator::euler);
  EXPECT_GT(costs_of(scenes::chain8(), Integrator::leapfrog), one);
  EXPECT_LT(costs_of(scenes::chain8(), Integrator::leapfrog), 2.0 * one);
  const auto costs = [&](Integrator integrator) { return costs_of(scenes::chain32(), integrator); };
  const double euler = costs(Integrator::euler), leapfrog = costs(Integrator::leapfrog);
  EXPECT_NEAR(costs(Integrator::extrapolated), 3.0 * leapfrog, 0.1 * leapfrog);
  EXPECT_NEAR(costs(Integrator::runge_kutta), 4.0 * euler, 0.5 * euler);
}

TEST(Flops, of_sweeps_grow_by_the_sweep) {
  const auto costs = [](Method method, int iterations, int velocity_iterations) {
    StepSettings settings = {.method = method};
    settings.iterations = iterations, settings.velocity_iterations = velocity_iterations;
    return compile(scenes::gripper13(), settings).flops_per_step();
  };
  const long sweep = costs(Method::pgs, 5, 1) - costs(Method::pgs, 4, 1);
  EXPECT_GT(sweep, 0);
  EXPECT_EQ(costs(Method::pgs, 9, 1), costs(Method::pgs, 4, 1) + 5 * sweep);
  EXPECT_EQ(costs(Method::pgs, 4, 3), costs(Method::pgs, 4, 1) + 2 * sweep);
  for (Method method : {Method::direct, Method::reduced}) {
    EXPECT_EQ(costs(method, 4, 1), costs(method, 900, 1)) << "iterations are not theirs";
    EXPECT_EQ(costs(method, 4, 1), costs(method, 4, 900)) << "any number closes once";
    EXPECT_LT(costs(method, 4, 0), costs(method, 4, 1));
  }
}

// Read: positions, velocities, efforts, the drives' two targets. Written: positions and velocities.
TEST(Bytes, are_those_of_the_state_the_inputs_and_the_fault) {
  const long numbers = 2 * 13 + 13 + 2 * 8 + 2 * 13;
  const Plan plan = compile(scenes::gripper13());
  EXPECT_EQ(plan.bytes_per_step(4), 4 * numbers + static_cast<long>(sizeof(Fault)));
  EXPECT_EQ(plan.bytes_per_step(8), 8 * numbers + static_cast<long>(sizeof(Fault)));
  const Plan fields = compile(scenes::gripper13(), {.per_environment = {Parameter::damping, Parameter::gravity}});
  EXPECT_EQ(fields.bytes_per_step(4), plan.bytes_per_step(4) + 4 * (13 + 3));
}

}  // namespace
}  // namespace lockstep
