// Steps by the tables whose routines are machine code, against steps by the tables alone. SPDX-License-Identifier:
// Apache-2.0
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <string>
#include <vector>

#include "batch/engine.h"
#include "divergence_scenes.h"
#include "lockstep/lockstep.h"
#include "reference/loop_models.h"
#include "targets/dispatch.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr int environments = 19;

struct Case {
  std::string name;
  Model model;
  StepSettings settings;
};

// Each in both integrators: without and with bounds, kept couplings, fields, friction that resists turning, impacts,
// and loops. By leapfrog, what its stages cannot hold.
std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](const std::string& name, const Model& model, StepSettings settings) {
    settings.dt = 1.0 / 240;
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
      settings.integrator = integrator;
      all.push_back({name + "_" + to_string(integrator), model, settings});
    }
  };
  add("grasp", Grasp{}.model(), {});
  add("grasp_with_kept_couplings", Grasp{}.model(), {.method = Method::direct});
  add("quadruped", quadruped(), {});
  add("limited_quadruped", limited_quadruped(false),
      {.per_environment = {Parameter::mass, Parameter::contact_friction, Parameter::drive_gains}});
  add("hand", hand_with_cube(), {.per_environment = {Parameter::mass}});
  Model bouncing = limited_quadruped(false);
  for (Collider& collider : bouncing.colliders)
    collider.restitution = 0.5, collider.torsional_friction = 0.01, collider.rolling_friction = 0.001;
  add("bouncing_quadruped", bouncing, {.record_efforts = true, .record_contacts = true});
  add("five_bar", loop_models::five_bar(), {});
  Model softly = Grasp{}.model();  // rows over several velocities, which no stage of leapfrog holds
  softly.couplings[0].softness = ErpCfm{};
  softly.couplings[0].force_limit = 20.0;
  softly.colliders.clear(), softly.contacts.clear();
  all.push_back({"coupling_with_a_force_limit_leapfrog", softly, {.integrator = Integrator::leapfrog}});
  return all;
}

class Routines : public testing::TestWithParam<Case> {};

template <class S>
double largest_difference(const Batch<S>& a, const Batch<S>& b) {
  double largest = 0.0;
  const auto compare = [&](const auto& ours, const auto& other) {
    if (ours.size() > 0)
      largest = std::max(largest, static_cast<double>(((ours - other).abs() / (S(1) + other.abs())).maxCoeff()));
  };
  compare(a.positions(), b.positions()), compare(a.velocities(), b.velocities());
  compare(a.root_poses(), b.root_poses()), compare(a.root_velocities(), b.root_velocities());
  return largest;
}

// Along a motion of the tables with targets that differ and with resets; each step from the same state.
template <class S>
void expect_the_steps_of_the_tables(const Case& own, Target target, double tolerance) {
  const Plan plan = compile(own.model, own.settings);
  if (!code_obstacle<S>(plan, resolve(target)).empty()) GTEST_SKIP() << code_obstacle<S>(plan, resolve(target));
  Batch<S> tables(plan, environments, {.threads = 1, .target = target, .engine = Engine::tables});
  Batch<S> compiled(plan, environments, {.threads = 1, .target = target, .engine = Engine::compiled});
  EXPECT_NE(compiled.describe().find("Its machine code, in bytes: "), std::string::npos);
  std::mt19937 random(11);
  const auto within = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  for (const Parameter parameter : {Parameter::mass, Parameter::contact_friction, Parameter::drive_gains}) {
    if (!own.settings.per_environment.contains(parameter)) continue;
    auto rows = tables.parameter(parameter);
    for (int e = 0; e < environments; ++e) rows.col(e) *= static_cast<S>(1.0 + within(0.3));
    compiled.parameter(parameter) = rows;
  }
  double largest = 0.0;
  int faults = 0;
  for (int i = 0; i < 240; ++i) {
    if (i % 12 == 0)
      for (const Joint& joint : own.model.joints)
        for (int e = 0; joint.drive.kp > 0.0 && e < environments; ++e)
          tables.position_targets()(plan.dof(joint.name), e) =
              static_cast<S>(joint.drive.position_target + within(0.5));
    if (i % 40 == 39) tables.reset(std::vector<int>{i % environments});
    compiled.restore(tables.save());
    const int steps = 1 + i % 2;  // what a call loads once must serve all its steps
    tables.step(steps), compiled.step(steps);
    largest = std::max(largest, largest_difference(std::as_const(compiled), std::as_const(tables)));
    for (int e = 0; e < environments; ++e) {
      EXPECT_EQ(tables.faults()[e], compiled.faults()[e]);
      faults += tables.faults()[e] != Fault::none;
    }
  }
  EXPECT_EQ(faults, 0);
  EXPECT_LT(largest, tolerance) << own.name;
}

TEST_P(Routines, make_the_steps_of_the_tables) {
  for (const Target target : {Target::avx2, Target::avx512}) {
    if (!supported(target)) continue;
    // Coefficients of leapfrog's stages are rounded in another order.
    expect_the_steps_of_the_tables<float>(GetParam(), target, GetParam().name.ends_with("euler") ? 1e-6 : 2e-4);
    expect_the_steps_of_the_tables<double>(GetParam(), target, 1e-12);
  }
}

// The numbers of an environment. Zeros have a sign.
std::string bits_of(const Batch<float>& batch, int e) {
  std::string bits;
  const auto add = [&](const auto& rows) {
    for (Eigen::Index row = 0; row < rows.rows(); ++row) {
      const float number = rows(row, e);
      bits.append(reinterpret_cast<const char*>(&number), sizeof(number));
    }
  };
  add(batch.positions()), add(batch.velocities()), add(batch.root_poses()), add(batch.root_velocities());
  return bits;
}

// Which routines a tile runs depends on all its lanes, and which of them are bounded or touch something.
TEST_P(Routines, do_not_know_the_neighbours) {
  const Case& own = GetParam();
  const Plan plan = compile(own.model, own.settings);
  if (!code_obstacle<float>(plan, resolve(Target::automatic)).empty()) GTEST_SKIP();
  Batch<float> all(plan, environments, {.threads = 1, .engine = Engine::compiled});
  std::vector<Batch<float>> alone;
  for (int e = 0; e < environments; e += 5) alone.emplace_back(plan, 1, BatchOptions{.threads = 1});
  std::mt19937 random(5);
  for (int i = 0; i < 40; ++i) {
    for (const Joint& joint : own.model.joints)
      for (int e = 0; joint.drive.kp > 0.0 && e < environments; ++e) {
        const int dof = plan.dof(joint.name);
        all.position_targets()(dof, e) = static_cast<float>(
            joint.drive.position_target + std::uniform_real_distribution<double>(-0.5, 0.5)(random) * (e % 3));
      }
    all.step(6);
    for (std::size_t k = 0; k < alone.size(); ++k) {
      const int e = 5 * static_cast<int>(k);
      ASSERT_EQ(alone[k].engine(), Engine::compiled);
      alone[k].position_targets().col(0) = all.position_targets().col(e);
      alone[k].step(6);
      EXPECT_EQ(bits_of(alone[k], 0), bits_of(all, e)) << e;
    }
  }
}

// Of a servo without damping, no routine reads the target of its speed. The tables multiply it by 0.
TEST(Routine, finds_nan_in_inputs_that_it_does_not_read) {
  Model model = Grasp{}.model();
  model.joints[2].drive.kd = 0.0;
  const Plan plan = compile(model, {.integrator = Integrator::euler});
  for (const Engine engine : {Engine::tables, Engine::automatic}) {
    Batch<float> batch(plan, environments, {.threads = 1, .engine = engine});
    batch.velocity_targets()(plan.dof("wrist"), 5) = std::numeric_limits<float>::quiet_NaN();
    batch.step(2);
    EXPECT_EQ(batch.faults()[5], Fault::not_finite);
    EXPECT_EQ(batch.faulted(), 1);
  }
}

INSTANTIATE_TEST_SUITE_P(All, Routines, testing::ValuesIn(cases()), [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace lockstep
