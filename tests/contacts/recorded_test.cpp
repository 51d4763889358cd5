// Impulses of couplings and balances of energy beside contacts. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

// A slider is pushed, and a second one that follows it at `ratio` presses a pad on a wall.
Model press(double ratio, bool hard) {
  Model m;
  m.gravity.setZero();
  for (const char* name : {"base", "push", "pad"}) {
    m.links.emplace_back();
    m.links.back().name = name, m.links.back().inertia = Inertia::box(0.5, Vector3d(0.1, 0.1, 0.1), Vector3d::Zero());
  }
  for (const char* name : {"push", "pad"}) {
    Joint joint;
    joint.name = name, joint.kind = JointKind::prismatic, joint.parent = "base", joint.child = name;
    joint.axis = Vector3d::UnitX();
    m.joints.push_back(joint);
  }
  m.couplings.push_back(Coupling::mimic("pad", "push", -ratio));
  if (!hard) m.couplings.back().softness = Spring{1e7, 1e4};
  Collider pad;
  pad.name = "pad", pad.link = "pad", pad.shape = Shape::box(Vector3d(0.1, 0.1, 0.1));
  m.colliders.push_back(pad);
  Collider wall;
  wall.name = "wall", wall.shape = Shape::box(Vector3d(0.1, 1.0, 1.0));
  wall.pose.translation().x() = 0.1;
  m.colliders.push_back(wall);
  m.contacts = {{"wall", "pad"}};
  return m;
}

// The force of the pad on the wall is effort / ratio, and the coupling carries it.
TEST(RecordedImpulses, of_couplings_carry_the_force_of_a_contact) {
  for (const double ratio : {1.0, 2.0})
    for (const Method method : {Method::reduced, Method::direct, Method::pgs})
      for (const bool hard : {true, false}) {
        StepSettings settings;
        settings.method = method;
        settings.record_impulses = true;
        settings.iterations = settings.velocity_iterations = 100;  // of pgs
        const Plan plan = compile(press(ratio, hard), settings);
        Batch<double> batch(plan, 2, {.threads = 1});
        batch.efforts()(plan.dof("push"), 0) = 30.0;
        batch.efforts()(plan.dof("push"), 1) = 60.0;
        batch.step(120);
        for (int e = 0; e < 2; ++e) {
          ASSERT_EQ(batch.faults()[e], Fault::none);
          EXPECT_NEAR(std::abs(batch.coupling_impulses()(0, e)), 30.0 * (e + 1) / ratio * settings.dt,
                      1e-4 * settings.dt * 30.0)
              << ratio << " " << to_string(method) << " " << hard;
        }
      }
}

// A box that slides to rest gives all of its energy to friction.
TEST(RecordedBalances, name_what_friction_takes) {
  Model model = block();
  model.roots[0].velocity[3] = 3.0;
  StepSettings settings;
  settings.dt = 1e-3;
  settings.record_diagnostics = true;
  const Plan plan = compile(model, settings);
  EXPECT_EQ(plan.integrator(), Integrator::euler);
  Batch<double> batch(plan, 1, {.threads = 1});
  batch.step(1000);
  const auto balance = batch.energy_balances();
  EXPECT_NEAR(balance(3, 0), -4.5, 0.01);  // change
  EXPECT_NEAR(balance(1, 0), 4.5, 0.02);   // dissipated
  EXPECT_NEAR(balance(0, 0), 0.0, 0.01);   // work
}

}  // namespace
}  // namespace lockstep
