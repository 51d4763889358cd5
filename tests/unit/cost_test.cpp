// The cost that a Plan reports is what the kernels do on counting numbers. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"
#include "counting/count.h"
#include "lockstep/lockstep.h"
#include "plan/program.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

// Counted steps are not audited, so their two rows are not read and written.
long of_audit(const Plan& plan) { return program_of(plan).f64.audited ? 4 : 0; }

void expect_counted(const Plan& plan) {
  const counting::Count counted = counting::count(plan);
  EXPECT_EQ(plan.flops_per_step(), counted.flops) << plan.describe();
  EXPECT_EQ(plan.bytes_per_step(4), 4 * (counted.numbers + of_audit(plan)) + 4 + 2 * 4) << plan.describe();
  EXPECT_EQ(plan.bytes_per_environment(8), 8 * counted.rows + 4 + 8 + 3 * 4 + 8) << plan.describe();
}

TEST(Cost, is_counted_for_every_method_and_integrator) {
  for (const std::string& name : scenes::names())
    for (const Method method : {Method::reduced, Method::direct, Method::pgs, Method::tgs}) {
      const Model model = scenes::scene(name).model;
      expect_counted(compile(model, {.method = method, .integrator = Integrator::euler}));
      if (method == Method::pgs || method == Method::tgs) continue;
      for (const Integrator integrator : {Integrator::leapfrog, Integrator::extrapolated})
        expect_counted(compile(model, {.method = method, .integrator = integrator}));
    }
  expect_counted(compile(scenes::chain8(), {.integrator = Integrator::runge_kutta}));
}

TEST(Cost, is_counted_with_parameters_impulses_and_inactive_ranges) {
  scenes::RandomOptions options;
  options.redundant = false;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    Model model = scenes::random_model(seed, options);
    StepSettings settings;
    settings.integrator = Integrator::euler;
    settings.method = seed % 4 == 0 ? Method::direct : seed % 4 == 1 ? Method::pgs : Method::automatic;
    settings.per_environment = {Parameter::mass, Parameter::damping, Parameter::drive_gains, Parameter::gravity};
    if (seed % 2 == 0) settings.per_environment.insert(Parameter::link_wrench);
    settings.record_impulses = seed % 3 == 0;
    expect_counted(compile(model, settings));
    for (Joint& joint : model.joints)
      if (joint.kind == JointKind::revolute || joint.kind == JointKind::prismatic)
        joint.lower = joint.position - 1e3, joint.upper = joint.position + 1e3;
    expect_counted(compile(model, settings));
  }
}

// Flops are those without a contact that acts.
TEST(Cost, counts_the_memory_of_contacts) {
  const Plan plan = compile(contact_scenes::block());
  const counting::Count counted = counting::count(plan);
  EXPECT_EQ(plan.bytes_per_step(4), 4 * (counted.numbers + of_audit(plan)) + 4 + 2 * 4) << plan.describe();
  EXPECT_EQ(plan.bytes_per_environment(8), 8 * counted.rows + 4 + 8 + 3 * 4 + 8);
}

}  // namespace
}  // namespace lockstep
