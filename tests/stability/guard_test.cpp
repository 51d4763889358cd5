// The guard: no motion gains energy from nowhere without a fault. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "contract.h"
#include "lockstep/import.h"
#include "physics.h"

namespace lockstep {
namespace {

using Eigen::ArrayXd;
using Eigen::Vector3d;

template <class S>
ArrayXd energies(const Batch<S>& batch) {
  return (batch.kinetic_energies() + batch.potential_energies()).row(0).transpose().template cast<double>();
}

// An undamped arm of six joints with axes z, y, z, y ... that falls from near its top, from `starts` places.
Model loose_arm() {
  Model model;
  model.name = "loose arm";
  model.links.push_back({"base", {}});
  for (int i = 0; i < 6; ++i) {
    const std::string name = std::to_string(i);
    const double length = 0.25 - 0.03 * i, mass = 1.5 - 0.22 * i;
    model.links.push_back({"l" + name, Inertia::box(mass, {0.05, 0.05, length}, {0.0, 0.0, 0.5 * length})});
    Joint joint;
    joint.name = "j" + name;
    joint.kind = JointKind::revolute;
    joint.parent = i == 0 ? "base" : "l" + std::to_string(i - 1);
    joint.child = "l" + name;
    joint.axis = i % 2 == 0 ? Vector3d::UnitZ() : Vector3d::UnitY();
    joint.lower = -3.0, joint.upper = 3.0;
    joint.position = i % 2 == 1 ? 0.3 : 0.0;
    if (i > 0) joint.origin.translation() = Vector3d(0.0, 0.0, 0.25 - 0.03 * (i - 1));
    model.joints.push_back(joint);
  }
  return model;
}

struct Gains {
  double worst = -infinity;  // J above the start
  int above_one = 0, faulted = 0;
};

Gains largest_gains(const Model& model, StepSettings settings, double seconds, int starts = 16) {
  Batch<double> batch(compile(model, settings), starts, {.threads = 1});
  contract::Random random(7);
  for (int e = 0; e < starts; ++e)
    for (int j = 0; j < batch.positions().rows(); ++j) batch.positions()(j, e) += random.uniform(-0.2, 0.2);
  batch.project();
  const ArrayXd start = energies(batch);
  ArrayXd gain = ArrayXd::Constant(starts, -infinity);
  for (int i = 0; i < std::lround(seconds / settings.dt); ++i) {
    batch.step();
    gain = gain.max(energies(batch) - start);
  }
  return {gain.maxCoeff(), static_cast<int>((gain > 1.0).count()), batch.faulted()};
}

TEST(Guard, keeps_a_loose_arm_from_gaining_energy) {
  for (const double dt : {1.0 / 60, 1.0 / 240}) {
    SCOPED_TRACE(dt);
    StepSettings settings{.dt = dt};
    const Gains guarded = largest_gains(loose_arm(), settings, 10.0);
    EXPECT_LT(guarded.worst, 1.0);
    EXPECT_LE(guarded.faulted, dt > 0.01 ? 2 : 0) << "a step of 1/1920 s may be too long for the wildest";
    settings.guard = infinity;
    EXPECT_GT(largest_gains(loose_arm(), settings, 10.0).worst, 1.0) << "the scene needs no guard";
  }
}

TEST(Guard, flags_a_loose_arm_by_other_integrators_and_methods) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
    for (const Method method : {Method::reduced, Method::pgs, Method::tgs}) {
      if (integrator == Integrator::leapfrog && method != Method::reduced) continue;
      StepSettings settings{.dt = 1.0 / 120, .method = method, .integrator = integrator};
      SCOPED_TRACE(std::string(to_string(integrator)) + " " + to_string(method));
      EXPECT_LT(largest_gains(loose_arm(), settings, 5.0).worst, 2.0);
    }
}

TEST(Guard, does_not_mind_a_balanced_rotor) {
  Model model;
  model.links = {{"base", {}}, {"rotor", Inertia::box(1.0, {0.1, 0.1, 0.2}, Vector3d::Zero())}};
  Joint joint;
  joint.name = "shaft", joint.kind = JointKind::continuous, joint.parent = "base", joint.child = "rotor";
  joint.axis = Vector3d::UnitZ();
  joint.velocity = 1000.0;
  model.joints = {joint};
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog, Integrator::runge_kutta}) {
    Batch<double> batch(compile(model, {.integrator = integrator}), 1, {.threads = 1});
    batch.step(240);
    EXPECT_EQ(batch.faulted(), 0) << to_string(integrator);
    EXPECT_NEAR(batch.velocities()(0, 0), 1000.0, 1e-9);
  }
}

TEST(Guard, names_the_fault_the_joint_and_the_remedy) {
  Batch<double> batch(compile(loose_arm(), {.dt = 1.0 / 60, .integrator = Integrator::euler}), 1, {.threads = 1});
  batch.velocities() += 3.0;
  for (int i = 0; i < 600 && batch.faulted() == 0; ++i) batch.step();
  ASSERT_EQ(batch.faults()[0], Fault::too_fast);
  const std::string words = batch.explain_fault(0);
  for (const char* part : {"too_fast", "too fast for the step", "the fastest joint is 'j", "smaller dt"})
    EXPECT_NE(words.find(part), std::string::npos) << words;
  EXPECT_EQ(batch.fault_report(0).stage, FaultStage::energy);
  EXPECT_EQ(batch.fault_report(0).step, batch.steps()[0]);
  EXPECT_GE(batch.fault_report(0).dof, 0);
  batch.reset();
  EXPECT_EQ(batch.faulted(), 0);
}

TEST(Guard, counts_what_servos_and_efforts_put_in) {
  Model model = loose_arm();
  for (Joint& joint : model.joints)
    joint.drive = {.kp = 60.0, .kd = 4.0}, joint.damping = 0.3, joint.effort_limit = 40.0;
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<double> batch(compile(model, {.integrator = integrator}), 8, {.threads = 1});
    contract::Random random(3);
    for (int i = 0; i < 200; ++i) {
      for (auto& target : batch.position_targets().reshaped()) target = random.uniform(-1.0, 1.0);
      for (auto& effort : batch.efforts().reshaped()) effort = random.uniform(-5.0, 5.0);
      batch.step(8);
    }
    EXPECT_EQ(batch.faulted(), 0) << to_string(integrator) << ": " << batch.explain_fault(0);
  }
}

TEST(Guard, refuses_what_is_no_limit) {
  for (const double guard : {0.0, -1.0, std::nan("")})
    EXPECT_THROW(compile(loose_arm(), {.guard = guard}), SettingsError);
}

// Masses over four decades, ratios from 0.02 to 50, limits, friction, damping. What an environment can lose is its
// kinetic energy, and the potential energy down to the lowest of many places.
Model passive(std::uint64_t seed) {
  contract::Random random(seed);
  const auto power = [&](double low, double high) { return std::pow(10.0, random.uniform(low, high)); };
  Model model;
  model.name = "passive " + std::to_string(seed);
  model.links.push_back({"base", {}});
  const int joints = 2 + static_cast<int>(random.uniform(0.0, 6.0));
  const bool limited = random.chance(0.5), dry = random.chance(0.3), damped = random.chance(0.3);
  std::vector<double> length;
  for (int i = 0; i < joints; ++i) {
    const int parent = i == 0 ? -1 : random.chance(0.75) ? i - 1 : static_cast<int>(random.uniform(0.0, i));
    length.push_back(random.uniform(0.05, 0.5));
    model.links.push_back(
        {"l" + std::to_string(i),
         Inertia::box(power(-3.0, 1.0), {length[i], 0.1 * length[i], 0.1 * length[i]}, {0.5 * length[i], 0.0, 0.0})});
    Joint joint;
    joint.name = "j" + std::to_string(i);
    joint.kind = JointKind::revolute;
    joint.parent = parent < 0 ? "base" : "l" + std::to_string(parent);
    joint.child = "l" + std::to_string(i);
    joint.axis = Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)).normalized();
    if (parent >= 0) joint.origin.translation() = Vector3d(length[static_cast<std::size_t>(parent)], 0.0, 0.0);
    joint.position = random.uniform(-1.0, 1.0);
    if (limited)
      joint.lower = joint.position - random.uniform(0.0, 2.5), joint.upper = joint.position + random.uniform(0.01, 2.5);
    if (limited && random.chance(0.25)) joint.restitution = random.uniform(0.0, 1.0);
    if (dry) joint.friction = power(-3.0, 0.0);
    if (damped) joint.damping = power(-4.0, -1.0);
    if (random.chance(0.25)) joint.velocity_limit = random.uniform(1.0, 10.0);
    model.joints.push_back(joint);
  }
  if (random.chance(0.6)) {
    Joint& follower = model.joints.back();
    follower.lower = -infinity, follower.upper = infinity, follower.velocity_limit = infinity,
    follower.restitution = 0.0;
    model.couplings.push_back(
        Coupling::mimic(follower.name, model.joints[0].name, power(std::log10(0.02), std::log10(50.0))));
    model.couplings.back().offset = 0.0;
  }
  return model;
}

int silent_gains(Integrator integrator, double dt, std::uint64_t first, int models) {
  constexpr int environments = 8;
  int found = 0;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(models); ++seed) {
    const Model model = passive(seed);
    Batch<double> batch(compile(model, {.dt = dt, .integrator = integrator}), environments, {.threads = 1});
    contract::Random random(seed + 1);
    double lowest = infinity;
    for (int round = 0; round < 20; ++round) {
      for (int j = 0; j < batch.positions().rows(); ++j)
        for (int e = 0; e < environments; ++e)
          batch.positions()(j, e) = random.uniform(std::max(model.joints[static_cast<std::size_t>(j)].lower, -3.1),
                                                   std::min(model.joints[static_cast<std::size_t>(j)].upper, 3.1));
      batch.project();
      lowest = std::min(lowest, batch.potential_energies().minCoeff());
    }
    batch.reset();
    for (auto& v : batch.velocities().reshaped()) v = random.uniform(-5.0, 5.0);
    batch.project();
    for (int e = 0; e < environments; ++e)
      batch.velocities().col(e) *= 5.0 / std::max(5.0, batch.velocities().col(e).abs().maxCoeff());
    const ArrayXd start = energies(batch), kinetic = batch.kinetic_energies().row(0).transpose();
    const ArrayXd has = kinetic + (start - kinetic - std::min(lowest, batch.potential_energies().minCoeff()));
    ArrayXd gain = ArrayXd::Constant(environments, -infinity);
    for (int i = 0; i < std::lround(2.0 / dt); ++i) {
      batch.step();
      const ArrayXd now = energies(batch);
      for (int e = 0; e < environments; ++e)
        if (batch.faults()[e] == Fault::none) gain[e] = std::max(gain[e], (now[e] - start[e]) / has[e]);
    }
    for (int e = 0; e < environments; ++e)
      if (batch.faults()[e] == Fault::none && gain[e] > 0.05) {
        ++found;
        ADD_FAILURE() << to_string(integrator) << " " << model.name << " environment " << e << " gains " << gain[e];
      }
  }
  return found;
}

TEST(Guard, finds_every_passive_model_that_gains_energy) {
  EXPECT_EQ(silent_gains(Integrator::automatic, 1.0 / 240, 0, 60), 0);
  EXPECT_EQ(silent_gains(Integrator::automatic, 1.0 / 60, 1000, 60), 0);
  EXPECT_EQ(silent_gains(Integrator::euler, 1.0 / 60, 2000, 40), 0);
}

}  // namespace
}  // namespace lockstep
