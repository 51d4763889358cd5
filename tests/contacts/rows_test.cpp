// Rows over several velocities beside contacts: against the reference, and hands that live with them.
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "contact_scenes.h"
#include "physics.h"
#include "plan/program.h"
#include "reference/contacts.h"
#include "reference/random_bounds.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr double radius = 0.05;

// Whether some joint, or its floating root, moves the link.
bool moves(const Model& model, int link) {
  for (std::string name = model.links[static_cast<std::size_t>(link)].name;;) {
    const auto joint = std::find_if(model.joints.begin(), model.joints.end(),
                                    [&](const Joint& j) { return j.kind != JointKind::tendon && j.child == name; });
    if (joint == model.joints.end())
      return std::any_of(model.roots.begin(), model.roots.end(),
                         [&](const Root& root) { return root.link == name && root.floating; });
    if (joint->moves()) return true;
    name = joint->parent;
  }
}

// A random mechanism with bounds of all kinds, and balls on its last links at a floor.
Model random_scene(int seed) {
  Model model = physics::random_bounds(seed);
  for (Joint& joint : model.joints) joint.restitution = 0.0;
  for (Coupling& coupling : model.couplings)  // hard ones hold at the start, soft ones are too stiff to be folded
    coupling.softness = is_hard(coupling.softness) ? Softness{Hard{0.0}} : Softness{Spring{3e7, 3e3}};
  const reference::Mechanism mechanism(model);
  const std::vector<Eigen::Isometry3d> links = mechanism.link_poses(mechanism.initial_state());
  double lowest = infinity;
  const int count = static_cast<int>(model.links.size());
  for (int link = std::max(1, count - 3); link < count; ++link) {
    if (!moves(model, link)) continue;
    Collider ball;
    ball.name = "ball" + std::to_string(link), ball.link = model.links[static_cast<std::size_t>(link)].name;
    ball.shape = Shape::sphere(radius), ball.friction = 0.3 + 0.1 * (seed % 7);
    model.colliders.push_back(ball);
    lowest = std::min(lowest, links[static_cast<std::size_t>(link)].translation().z());
  }
  add_floor(model, 0.6);
  model.colliders.back().pose.translation().z() = lowest - radius + 1e-3 * (seed % 5 - 2);
  for (const Collider& collider : model.colliders)
    if (collider.name != "floor") model.contacts.push_back({"floor", collider.name});
  return model;
}

// Whether the reference and the plan eliminate the same joints, so that both have the same compliance of contacts.
bool same_basis(const Plan& plan) {
  std::vector<int> first;
  for (const Coupling& coupling : plan.model().couplings)
    if (is_hard(coupling.softness) && coupling.force_limit == infinity) first.push_back(plan.dof(coupling.joint));
  std::vector<int> eliminated = plan.eliminated_dofs();
  std::sort(first.begin(), first.end()), std::sort(eliminated.begin(), eliminated.end());
  return first == eliminated && program_of(plan).folded.empty();
}

TEST(RowsBesideContacts, agree_with_the_reference) {
  StepSettings settings;
  settings.integrator = Integrator::euler;
  settings.method = Method::reduced;
  settings.contacts = {1, 300, 1e-11};
  settings.velocity_iterations = 0;
  int compared = 0, with_slots = 0, pressing = 0, off = 0, ours = 0;
  std::vector<double> errors;
  for (int seed = 0; seed < 700; ++seed) {
    const Model model = random_scene(seed);
    if (model.contacts.empty()) continue;
    const Plan plan = compile(model, settings);
    if (!same_basis(plan)) continue;
    Batch<double> batch(plan, 1, {.threads = 1});
    batch.project();
    const reference::Mechanism mechanism(model);
    const reference::State start = physics::state_of(batch);
    std::optional<reference::ContactStep> truth;
    try {
      truth = reference::contact_step(mechanism, settings, start, mechanism.initial_inputs());
    } catch (const std::logic_error&) {  // the projected gradient has not converged
      ++off;
      continue;
    }
    batch.step(1);
    ASSERT_EQ(batch.faults()[0], Fault::none) << seed;
    reference::State end = mechanism.advanced(start, truth->velocity, settings.dt);
    end.v = truth->velocity;
    mechanism.turn_axes(start, end);
    const Query query{Quantity::unfinished_contacts};
    double unfinished = 0.0;
    batch.read(std::span(&query, 1), {&unfinished, 1, 1});
    if (unfinished > 0.0) {
      ++ours;
      continue;
    }
    const double moving = std::max({1.0, truth->velocity.cwiseAbs().maxCoeff(), start.v.cwiseAbs().maxCoeff()});
    errors.push_back(physics::distance(physics::state_of(batch).v, end.v) / moving);
    const bool presses = std::any_of(truth->impulses.begin(), truth->impulses.end(),
                                     [](const Vector3d& impulse) { return impulse[0] > 0.0; });
    ++compared, pressing += presses, with_slots += program_of(plan).f64.rounds.slots.count > 0;
  }
  std::sort(errors.begin(), errors.end());
  std::printf(
      "compared %d, with slots %d, pressing %d, unfinished %d and %d of the reference; median %.2g, 99 %% %.2g, worst "
      "%.2g\n",
      compared, with_slots, pressing, ours, off, errors[errors.size() / 2], errors[errors.size() * 99 / 100],
      errors.back());
  EXPECT_GT(compared, 200);
  EXPECT_GT(with_slots, 100);
  EXPECT_GT(pressing, 100);
  EXPECT_LT(errors[errors.size() / 2], 1e-10);
  EXPECT_LT(errors[errors.size() * 97 / 100], 1e-6);  // the rest: rows that slow updates take for contradictions
}

template <class S>
class TendonsBesideContacts : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(TendonsBesideContacts, Precisions);

// Environments pull with different efforts and at different times, so that no two lanes do the same.
template <class S>
void hold_their_ends_and_press(Integrator integrator, double tolerance) {
  const Model model = finger();
  StepSettings settings;
  settings.integrator = integrator;
  settings.per_environment = {Parameter::effort_limit};
  const Plan plan = compile(model, settings);
  const int t = plan.dof("t"), environments = 24;
  Batch<S> batch(plan, environments, {.threads = 1});
  physics::Uniform uniform{std::mt19937_64(3)};
  for (int e = 0; e < environments; ++e)
    batch.parameter(Parameter::effort_limit)(t, e) = static_cast<S>(uniform(0.05, 0.3));
  const Query query{Quantity::contact_normal_force};
  std::vector<S> normal(environments);
  int at_end = 0, pressing = 0;
  double beyond = 0.0;
  for (int step = 0; step < 1200; ++step) {
    if (step % 60 == 0)
      for (int e = 0; e < environments; ++e)
        batch.position_targets()(t, e) = static_cast<S>(uniform(0.0, 1.0) < 0.7 ? 2.0 : -0.5);
    batch.step(1);
    for (int e = 0; e < environments; ++e) {
      ASSERT_EQ(batch.faults()[e], Fault::none) << step << " " << e << " " << batch.explain_fault(e);
      const double length = static_cast<double>(batch.positions()(t, e));
      beyond = std::max(beyond, length - 1.2);
      at_end += length > 1.2 - 1e-6;
      ASSERT_NEAR(length, static_cast<double>(batch.positions()(0, e) + batch.positions()(1, e)), 1e-6);
    }
    batch.read(std::span(&query, 1), {normal.data(), environments, 1});
    for (const S force : normal) pressing += force > S(0.01);
  }
  EXPECT_LT(beyond, tolerance);
  EXPECT_GT(at_end, 500);
  EXPECT_GT(pressing, 100);
}
TYPED_TEST(TendonsBesideContacts, hold_their_ends_and_press) {
  hold_their_ends_and_press<TypeParam>(Integrator::euler, sizeof(TypeParam) == 4 ? 2e-6 : 1e-11);
}

// A follower's range is met at the midpoints, and at the ends of steps up to what a push-out leaves.
TYPED_TEST(TendonsBesideContacts, hold_their_ends_and_press_in_leapfrog) {
  hold_their_ends_and_press<TypeParam>(Integrator::leapfrog, sizeof(TypeParam) == 4 ? 1e-4 : 2e-6);
}

// Every kind of row that is not a single velocity, beside a contact that presses.
struct Row {
  const char* name;
  void (*add)(Model&, StepSettings&);
};
void PrintTo(const Row& row, std::ostream* out) { *out << row.name; }

class RowBesideContact : public testing::TestWithParam<Row> {};

TEST_P(RowBesideContact, is_accepted_by_default_and_by_reduced) {
  for (const Method method : {Method::automatic, Method::reduced}) {
    Model model = wall();
    StepSettings settings;
    settings.method = method;
    GetParam().add(model, settings);
    const Plan plan = compile(model, settings);
    EXPECT_GT(program_of(plan).f64.rounds.slots.count, 0);
    Batch<double> batch(plan, 5, {.threads = 1});
    batch.step(480);
    for (int e = 0; e < 5; ++e) EXPECT_EQ(batch.faults()[e], Fault::none);
    EXPECT_LT(batch.velocities().abs().maxCoeff(), 1e-3);  // it has come to rest
  }
}

INSTANTIATE_TEST_SUITE_P(
    kind, RowBesideContact,
    testing::Values(
        Row{"soft_limit",
            [](Model& model, StepSettings&) {
              model.joints[1].lower = -2.0, model.joints[1].upper = -0.02;
              model.joints[1].limit_softness = Spring{5.0, 0.1};
            }},
        Row{"soft_drive",
            [](Model& model, StepSettings&) {
              model.joints[0].drive = {.position_target = 1.0, .kinematic = true, .softness = Spring{5.0, 0.5}};
            }},
        Row{"force_limit", [](Model& model, StepSettings&) { model.couplings[0].force_limit = 0.05; }},
        Row{"stiff_coupling",
            [](Model& model, StepSettings&) {
              model.couplings[0].softness = Spring{1e6, 1e3};
            }}),
    [](const testing::TestParamInfo<Row>& info) { return std::string(info.param.name); });

TEST(RowsBesideContacts, include_softness_and_switches_per_environment) {
  for (const Parameter field : {Parameter::softness, Parameter::coupling_switch}) {
    Model model = wall();
    model.couplings[0].softness = Spring{50.0, 0.5};
    StepSettings settings;
    settings.per_environment = {field};
    const Plan plan = compile(model, settings);
    Batch<double> batch(plan, 5, {.threads = 1});
    batch.parameter(field)(0, 1) = field == Parameter::softness ? 500.0 : 0.0;
    batch.step(480);
    for (int e = 0; e < 5; ++e) EXPECT_EQ(batch.faults()[e], Fault::none);
    EXPECT_GT(std::abs(batch.positions()(1, 0) - batch.positions()(1, 1)), 1e-5);
    EXPECT_EQ(batch.positions()(1, 0), batch.positions()(1, 2));
  }
}

}  // namespace
}  // namespace lockstep
