// Steps of the reference with bounds on random mechanisms. SPDX-License-Identifier: Apache-2.0
#include "reference/bounded.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "physics.h"
#include "random_bounds.h"

namespace lockstep::reference {
namespace {

using physics::distance;
using physics::methods;
using physics::sliders;

// The velocity phases of direct and reduced minimise the same function. Without friction, positions agree as well.
TEST(ReferenceBoundedStep, differs_between_direct_and_reduced_only_by_friction_on_corrections) {
  for (int seed = 0; seed < 150; ++seed) {
    Model model = physics::random_bounds(seed);
    if (seed % 2 == 0)
      for (Joint& joint : model.joints) joint.friction = 0.0;
    const Mechanism mechanism(model);
    const auto after = [&](Method method) {
      return step(mechanism, physics::settings(method), mechanism.initial_state(), mechanism.initial_inputs());
    };
    const Step a = after(Method::direct), b = after(Method::reduced);
    const double size = std::max(1.0, physics::size(a.state.v));
    EXPECT_LE(distance(a.state.v, b.state.v), 1e-9 * size) << seed;
    if (seed % 2 == 0) {
      EXPECT_LE(distance(a.state.q, b.state.q), 1e-9 * size) << seed;
    }
  }
}

// Sweeps converge to the solution of all rows at once.
TEST(ReferenceBoundedStep, converges_to_that_of_direct_with_many_sweeps_of_pgs) {
  int compared = 0;
  for (int seed = 0; seed < 60; ++seed) {
    const Model model = physics::random_bounds(seed);
    const Mechanism mechanism(model);
    const auto after = [&](Method method, int iterations) {
      return step(mechanism, physics::settings(method, iterations, iterations), mechanism.initial_state(),
                  mechanism.initial_inputs());
    };
    const Step exact = after(Method::direct, 1), fewer = after(Method::pgs, 500), swept = after(Method::pgs, 2000);
    const double size = std::max(1.0, physics::size(exact.state.v));
    // Compare only where the sweeps have converged: nearly dependent rows take more sweeps than a test can make.
    if (distance(fewer.state.v, swept.state.v) > 1e-12 * size) continue;
    if (distance(fewer.state.q, swept.state.q) > 1e-14 * size) continue;
    ++compared;
    EXPECT_LE(distance(exact.state.v, swept.state.v), 1e-9 * size) << seed;
    EXPECT_LE(distance(exact.state.q, swept.state.q), 1e-9 * size) << seed;
  }
  EXPECT_GT(compared, 30);
}

// One sub-step of tgs is one sweep of pgs, and their velocity iterations are the same.
TEST(ReferenceBoundedStep, is_the_same_for_one_sub_step_of_tgs_and_one_sweep_of_pgs) {
  for (int seed = 0; seed < 100; ++seed) {
    const Mechanism mechanism(physics::random_bounds(seed));
    const auto after = [&](Method method) {
      return step(mechanism, physics::settings(method, 1, seed % 3), mechanism.initial_state(),
                  mechanism.initial_inputs());
    };
    const Step a = after(Method::pgs), b = after(Method::tgs);
    const double size = std::max(1.0, physics::size(a.state.v));
    EXPECT_LE(distance(a.state.v, b.state.v), 1e-11 * size) << seed;
    EXPECT_LE(distance(a.state.q, b.state.q), 1e-11 * size) << seed;
    EXPECT_LE(distance(a.impulses, b.impulses), 1e-11 * std::max(size, physics::size(a.impulses))) << seed;
  }
}

// Joints rest at their limits, stick and slip, and couplings make many of their bounds depend on each other. The
// reference throws if it cannot find and check the solution of a step.
TEST(ReferenceBoundedStep, is_found_all_along_a_motion) {
  for (int seed = 0; seed < 40; ++seed) {
    Model model = physics::random_bounds(seed);
    for (Joint& joint : model.joints) {
      joint.friction = 0.3;
      if (joint.drive.kinematic) joint.drive.softness = Spring{500.0, 50.0};  // soft ones cannot contradict each other
    }
    const Mechanism mechanism(model);
    for (const Method method : {Method::direct, Method::reduced}) {
      State state = mechanism.initial_state();
      for (int n = 0; n < 60; ++n)
        ASSERT_NO_THROW(state = step(mechanism, physics::settings(method), state, mechanism.initial_inputs()).state)
            << seed << " " << to_string(method) << " " << n;
    }
  }
}

// The mass matrix of sliders is constant, and all bounds allow rest. So hard bounds and friction can only remove
// energy.
TEST(ReferenceBoundedStep, adds_no_energy) {
  physics::Uniform random{std::mt19937_64(9)};
  for (int scene = 0; scene < 30; ++scene) {
    Model model = sliders({random(0.5, 2.0), random(0.5, 2.0), random(0.5, 2.0), random(0.5, 2.0)});
    model.couplings = {Coupling::mimic("s0", "s1", random(-2.0, 2.0)), Coupling::mimic("s2", "s3", -1.0, 0.01)};
    for (Joint& joint : model.joints) {
      joint.velocity = random(-1.0, 1.0);
      if (random(0.0, 1.0) < 0.5) joint.lower = random(-0.05, 0.0), joint.upper = random(0.0, 0.05);
      if (random(0.0, 1.0) < 0.5) joint.friction = random(0.0, 1.0);
    }
    model.couplings[0].force_limit = random(0.1, 10.0);
    const Mechanism mechanism(model);
    for (const Method method : {Method::direct, Method::reduced}) {
      State state = mechanism.initial_state();
      double energy = mechanism.kinetic_energy(state);
      for (int n = 0; n < 40; ++n) {
        state = step(mechanism, physics::settings(method), state, mechanism.initial_inputs()).state;
        const double now = mechanism.kinetic_energy(state);
        EXPECT_LE(now, energy * (1.0 + 1e-11) + 1e-20) << scene;
        energy = now;
      }
    }
  }
}

TEST(ReferenceCouplingSwitch, removes_a_coupling_and_lets_a_redundant_one_act) {
  Model model = sliders({1.0, 2.0, 3.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.1), Coupling::mimic("s1", "s2", -1.0, -0.2),
                     Coupling::mimic("s0", "s2", -1.0, -0.1)};  // the sum of the others
  model.joints[1].effort = 1.0;
  const Mechanism all(model);
  for (int out = 0; out < 3; ++out) {
    Model without = model;
    without.couplings.erase(without.couplings.begin() + out);
    const Mechanism fewer(without);
    Inputs inputs = all.initial_inputs();
    inputs.off.assign(3, false);
    inputs.off[out] = true;
    for (const Method method : methods) {
      const StepSettings settings = physics::settings(method);
      const Step a = step(all, settings, all.initial_state(), inputs);
      const Step b = step(fewer, settings, fewer.initial_state(), fewer.initial_inputs());
      EXPECT_EQ(distance(a.state.q, b.state.q), 0.0) << to_string(method) << out;
      EXPECT_EQ(distance(a.state.v, b.state.v), 0.0);
      EXPECT_EQ(a.impulses[out], 0.0);
    }
  }
}

TEST(ReferenceIgnoredBounds, act_like_a_model_without_them) {
  for (int seed = 0; seed < 20; ++seed) {
    const Model model = physics::random_bounds(seed);
    const Mechanism mechanism(model);
    for (const Method method : methods) {
      StepSettings settings = physics::settings(method);
      settings.ignore = {true, true, true, true};
      const Mechanism unbounded(without(settings.ignore, model));
      const State a = step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs()).state;
      settings.ignore = {};
      const State b = step(unbounded, settings, unbounded.initial_state(), unbounded.initial_inputs()).state;
      EXPECT_EQ(distance(a.v, b.v), 0.0);
      for (const Joint& joint : unbounded.model().joints) {
        EXPECT_EQ(joint.lower, -infinity);
        EXPECT_EQ(joint.friction, 0.0);
        EXPECT_EQ(joint.velocity_limit, infinity);
        EXPECT_EQ(joint.effort_limit, infinity);
      }
    }
  }
}

}  // namespace
}  // namespace lockstep::reference
