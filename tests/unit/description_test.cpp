// The description of a Plan and the cost of its step. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "lockstep/batch.h"
#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

// ---------------------------------------------------------------- describe()

void expect_contains(const Plan& plan, std::initializer_list<const char*> parts) {
  const std::string text = plan.describe();
  for (const char* part : parts) EXPECT_NE(text.find(part), std::string::npos) << "no '" << part << "' in\n" << text;
}

void expect_omits(const Plan& plan, std::initializer_list<const char*> parts) {
  const std::string text = plan.describe();
  for (const char* part : parts) EXPECT_EQ(text.find(part), std::string::npos) << "'" << part << "' in\n" << text;
}

TEST(Description, names_the_method_its_reason_and_what_it_costs) {
  const Plan plan = compile(scenes::gripper13());
  expect_contains(plan, {"gripper13: fixed base, 13 moving joints, 5 couplings", "Method: reduced (hard couplings",
                         "Integrator: leapfrog", "dt 0.00416667 s (240 Hz)", "eliminated: j8, j9, j10, j11, j12"});
  expect_contains(plan, {(std::to_string(plan.flops_per_step()) + " flops").c_str(),
                         (std::to_string(plan.bytes_per_step(4)) + " bytes").c_str(),
                         (std::to_string(plan.bytes_per_step(8)) + " in f64").c_str()});
  expect_contains(compile(scenes::gripper13(), {.method = Method::tgs}),
                  {"Method: tgs (as asked for)", "5 rows, 4 sub-steps of one sweep, then 1 velocity iteration"});
  expect_contains(compile(scenes::gripper13(), {.method = Method::pgs}),
                  {"Method: pgs (as asked for)", "5 rows, 4 sweeps"});
  expect_contains(
      compile(scenes::chain8(), {.per_environment = {Parameter::softness}}),
      {"Method: direct (softness or switches of couplings differ per environment", "4 rows are solved together"});
}

// Plans with solved rows have constraint velocities (M77) where A is formed and each coupling has a joint of its own.
TEST(Description, tells_whether_constraint_velocities_are_solved_for) {
  const char* const speeds = "constraint velocities in place of followers'";
  StepSettings settings{.method = Method::pgs, .integrator = Integrator::euler};
  expect_contains(compile(scenes::chain8(), settings), {speeds, "responses, row terms, pgs"});
  expect_omits(compile(scenes::chain32(), settings), {speeds});  // articulated bodies cost less
  expect_omits(compile(scenes::gear100(), settings), {speeds});  // elimination would leave too small a share of A
  settings.method = Method::direct;
  expect_contains(compile(scenes::chain8(), settings),
                  {speeds, "4 rows are met by known constraint velocities.", "known constraint velocities"});
  Model limited = scenes::chain8();
  limited.joints[0].lower = -1.0;
  expect_contains(compile(limited, settings),
                  {"met by known constraint velocities, solved together by L^T D L where bounds are active"});
  settings.record_impulses = true;
  expect_contains(compile(scenes::chain8(), settings),
                  {speeds, "4 rows are solved together", "responses, row terms, direct"});
  settings.per_environment = {Parameter::gear_ratio};
  expect_omits(compile(scenes::chain8(), settings), {speeds});
  Model soft = scenes::chain8();
  for (Coupling& coupling : soft.couplings) coupling.softness = Spring{1e6, 1e4};
  expect_contains(compile(soft, {.integrator = Integrator::euler}), {speeds, "responses, row terms, direct"});
}

TEST(Description, tells_whether_soft_couplings_are_folded) {
  Model soft = scenes::chain8();
  for (Coupling& coupling : soft.couplings) coupling.softness = Spring{40.0, 1.0};
  const Plan folded = compile(soft, {.integrator = Integrator::euler});
  expect_contains(folded, {"4 soft couplings are folded into the matrix, so that no row is left to solve.",
                           "soft couplings folded into the matrix, free velocity"});
  expect_omits(folded, {"responses", "elimination", "solver rows", "not folded"});
  soft.couplings[1].softness = Spring{1e8, 1e6};
  expect_contains(compile(soft, {.integrator = Integrator::euler}),
                  {"soft couplings are not folded into the matrix: coupling 'j1' is so stiff", "4 rows are solved"});
  expect_omits(compile(scenes::chain8(), {.integrator = Integrator::euler}), {"folded"});
}

TEST(Description, describes_every_kind_of_softness) {
  Model model = scenes::chain8();
  model.couplings[0].softness = Hard{0.25};
  model.couplings[1].softness = ErpCfm{0.5, 0.125};
  model.couplings[2].softness = Spring{80.0, 2.5};
  model.couplings[3].softness = Frequency{12.566370614359172, 0.7};
  expect_contains(compile(model), {"hard (erp 0.25)", "erp 0.5, cfm 0.125", "kp 80, kd 2.5",
                                   "12.5664 rad/s (2 Hz), damping ratio 0.7"});
  model.couplings[2].softness = Spring{0.0, 0.0};
  expect_contains(compile(model), {"absent: it has neither stiffness nor damping"});
  expect_contains(compile(scenes::redundant()), {"redundant: it follows from those above"});
}

TEST(Description, lists_features_that_were_left_out) {
  const Plan simple = compile(scenes::chain8());
  expect_contains(
      simple, {"Left out, because the scene has none:", "solver rows", "drives", "armature", "fields per environment"});
  expect_omits(simple, {"May differ"});
  const Plan full = compile(scenes::gripper13(), {.method = Method::direct,
                                                  .per_environment = {Parameter::gear_ratio, Parameter::link_wrench}});
  expect_omits(full, {"solver rows", "drives,", "fields per environment"});
  expect_contains(full, {"damping", "armature", "May differ per environment: gear_ratio, link_wrench."});
}

TEST(Description, says_why_an_engine_is_not_taken) {
  expect_omits(compile(scenes::chain8()), {"is not taken by itself", "does not apply"});
  Model model = scenes::chain8();
  model.joints[0].lower = -1.0;
  expect_omits(compile(model), {"is not taken by itself"});
  expect_contains(compile(model, {.integrator = Integrator::leapfrog, .stage_inputs = true}),
                  {"Engine: tables;", "taken by itself: leapfrog takes each step in which a bound"});
  model.joints[1].friction = 0.1;
  expect_omits(compile(model, {.record_diagnostics = true}), {"is not taken by itself"});
  model = scenes::chain32();
  model.joints[1].friction = 0.1;
  expect_contains(compile(model, {.record_diagnostics = true}),
                  {"taken by itself: friction, kinematic drives or force limits"});
  expect_contains(compile(scenes::chain8(), {.method = Method::tgs, .per_environment = {Parameter::softness}}),
                  {"Engine: tables; no kernel can be generated: method tgs with a softness per environment is computed",
                   "compiled does not apply: method tgs with a softness per environment"});
  expect_contains(compile(scenes::chain32(), {.method = Method::pgs, .iterations = 1000}),
                  {"no kernel can be generated: kernel would have a step of"});
}

TEST(Description, and_refusal_give_the_same_reason_against_machine_code) {
  const Plan plan = compile(scenes::chain8(), {.method = Method::tgs, .per_environment = {Parameter::softness}});
  try {
    Batch<float>(plan, 1, {.engine = Engine::compiled});
    FAIL() << "accepted";
  } catch (const SettingsError& error) {
    EXPECT_NE(error.rule().find("lane by lane"), std::string::npos) << error.what();
    expect_contains(plan, {error.rule().c_str()});
  }
}

TEST(Description, names_contacts_among_the_stages) {
  Model model = scenes::chain8();
  model.colliders = {{.name = "ground", .shape = Shape::half_space()},
                     {.name = "tip", .link = model.joints.back().child, .shape = Shape::sphere(0.01)}};
  model.contacts = {{"ground", "tip"}};
  const std::string text = compile(model).describe(), stages = text.substr(text.find("Stages"));
  EXPECT_NE(stages.substr(0, stages.find('\n')).find("contacts"), std::string::npos) << text;
}

// A block in the floor by 4 mm, and one on a slider in that by 30 mm, whichever integrator collides them.
TEST(Description, names_pairs_that_overlap_at_the_start) {
  Model model;
  const auto block = [&](const std::string& name, const Eigen::Vector3d& place) {
    model.links.push_back({name, Inertia::box(1.0, {0.1, 0.1, 0.1}, Eigen::Vector3d::Zero())});
    model.colliders.push_back({.name = name, .link = name, .shape = Shape::box({0.1, 0.1, 0.1}), .group = "blocks"});
    Root root{name, true};
    root.pose.translation() = place;
    return root;
  };
  model.roots = {block("low", {0.0, 0.0, 0.046}), block("far", {1.0, 0.0, 0.0505})};
  block("slid", Eigen::Vector3d::Zero());
  Joint slider;
  slider.name = "slider", slider.kind = JointKind::prismatic, slider.parent = "far", slider.child = "slid";
  slider.axis = Eigen::Vector3d::UnitX(), slider.position = -0.93;
  model.joints = {slider};
  model.colliders.push_back({.name = "floor", .shape = Shape::half_space()});
  model.contacts = {{"floor", "blocks"}, {"low", "slid"}, {"low", "far"}};
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const std::string words = compile(model, {.integrator = integrator}).describe();
    EXPECT_NE(
        words.find(
            "Overlap at the model's start, and push until they are apart: low-slid by 30 mm, floor-low by 4 mm. "),
        std::string::npos)
        << words;
  }
  model.roots[0].pose.translation().z() = 0.05, model.joints[0].position = -0.9;
  EXPECT_EQ(compile(model, {}).describe().find("Overlap at the model's start"), std::string::npos);
}

TEST(Description, lists_bounds_and_those_to_be_ignored) {
  Model model = scenes::chain8();
  expect_omits(compile(model), {"Bounds", "Ignored"});
  model.joints[0].lower = -1.0;
  model.joints[1].upper = 1.0;
  model.joints[2].velocity_limit = 3.0;
  model.joints[3].effort_limit = 5.0;
  model.joints[4].friction = 0.1;
  // j0 to j3 depend on the velocities of j2 and j3, so their bounds take two rows; the bound of j4 is one on j6.
  expect_contains(compile(model),
                  {"Bounds: 2 position ranges, 1 velocity limit, 1 effort limit, 1 dry friction; 3 rows",
                   "solved exactly through the couplings"});
  expect_contains(compile(model, {.method = Method::pgs}), {"4 rows", "swept after the couplings"});
  StepSettings some;
  some.ignore.friction = some.ignore.position_limits = true;
  expect_contains(compile(model, some), {"Bounds: 1 velocity limit, 1 effort limit; 1 row",
                                         "Left out by StepSettings::ignore: 2 position ranges, 1 dry friction"});
}

// ---------------------------------------------------------------- cost

TEST(Flops, are_zero_for_features_that_a_scene_does_not_have) {
  Model bare = scenes::chain8();
  bare.couplings.clear();
  for (Joint& joint : bare.joints) joint.damping = 0.0;
  const auto costs = [](const Model& model, StepSettings settings = {}) {
    settings.integrator = Integrator::euler;
    return compile(model, settings).flops_per_step();
  };
  const long base = costs(bare);
  EXPECT_GT(base, 8 * 100);
  EXPECT_LT(base, 8 * 1000);

  Model driven = bare;
  driven.joints[3].drive = {10.0, 1.0, 0.0, 0.0};
  EXPECT_GT(costs(driven), base);
  EXPECT_LT(costs(driven), base + 20) << "one drive, not eight";
  for (Method method : {Method::pgs, Method::tgs, Method::direct}) {
    Model with_coupling = bare;
    with_coupling.couplings = {scenes::chain8().couplings[0]};
    const long one = costs(with_coupling, {.method = method});
    if (method != Method::tgs) {  // tgs makes its sub-steps also without couplings
      EXPECT_EQ(costs(bare, {.method = method}), base) << to_string(method) << " without couplings";
    }
    EXPECT_GT(one, base);
    EXPECT_GT(costs(scenes::chain8(), {.method = method}), one);
  }
  for (Parameter parameter :
       {Parameter::drive_gains, Parameter::damping, Parameter::mass, Parameter::gravity, Parameter::link_wrench})
    EXPECT_GT(costs(bare, {.per_environment = {parameter}}), base) << to_string(parameter);
  for (Parameter parameter :
       {Parameter::gear_ratio, Parameter::offset, Parameter::softness, Parameter::coupling_switch})
    EXPECT_EQ(costs(bare, {.method = Method::direct, .per_environment = {parameter}}), base)
        << to_string(parameter) << " without couplings";
  Model limited = bare;
  for (Joint& joint : limited.joints) joint.lower = -1.0, joint.upper = 1.0;
  EXPECT_GT(costs(limited), base);
  EXPECT_LT(costs(limited), base + base / 10) << "inactive limits";
  limited.joints[0].friction = limited.joints[0].effort_limit = limited.joints[0].velocity_limit = 0.5;
  StepSettings without;
  without.ignore = {true, true, true, true};
  EXPECT_EQ(costs(limited, without), base) << "ignored bounds must cost nothing";
}

// A leapfrog takes the mass matrix once, the bias forces twice and four solves; the other integrators repeat steps.
TEST(Flops, count_every_evaluation_of_an_integrator) {
  const auto costs_of = [](const Model& model, Integrator integrator) {
    return static_cast<double>(compile(model, {.integrator = integrator}).flops_per_step());
  };
  // On chain8 both compute A_r by entries. On chain32 euler has a shorter way, which leapfrog cannot take.
  const double one = costs_of(scenes::chain8(), Integrator::euler);
  EXPECT_GT(costs_of(scenes::chain8(), Integrator::leapfrog), one);
  EXPECT_LT(costs_of(scenes::chain8(), Integrator::leapfrog), 2.0 * one);
  const auto costs = [&](Integrator integrator) { return costs_of(scenes::chain32(), integrator); };
  const double euler = costs(Integrator::euler), leapfrog = costs(Integrator::leapfrog);
  EXPECT_NEAR(costs(Integrator::extrapolated), 3.0 * leapfrog, 0.1 * leapfrog);
  EXPECT_NEAR(costs(Integrator::runge_kutta), 4.0 * euler, 0.5 * euler);
}

TEST(Flops, grow_linearly_with_sweeps) {
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
    EXPECT_EQ(costs(method, 4, 1), costs(method, 900, 1)) << "they have no iterations";
    EXPECT_EQ(costs(method, 4, 1), costs(method, 4, 900)) << "they have one velocity phase at most";
    EXPECT_LT(costs(method, 4, 0), costs(method, 4, 1));
  }
}

// A step reads positions, velocities, efforts and two targets per drive. It writes positions and velocities.
TEST(Bytes, count_the_state_the_inputs_and_the_fault) {
  const long numbers = 2 * 13 + 13 + 2 * 8 + 2 * 13 + 13 + 4;  // the last two: angles, the audit
  const Plan plan = compile(scenes::gripper13());
  EXPECT_EQ(plan.bytes_per_step(4), 4 * numbers + static_cast<long>(sizeof(Fault) + 2 * sizeof(std::uint32_t)));
  EXPECT_EQ(plan.bytes_per_step(8), 8 * numbers + static_cast<long>(sizeof(Fault) + 2 * sizeof(std::uint32_t)));
  const Plan fields = compile(scenes::gripper13(), {.per_environment = {Parameter::damping, Parameter::gravity}});
  EXPECT_EQ(fields.bytes_per_step(4), plan.bytes_per_step(4) + 4 * (13 + 3));
}

}  // namespace
}  // namespace lockstep
