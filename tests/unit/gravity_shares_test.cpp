// Links that have a share of gravity fall, hang and rest by it. SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "contact_scenes.h"
#include "lockstep/plan.h"
#include "physics.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::Vector3d;

constexpr Integrator integrators[] = {Integrator::euler, Integrator::leapfrog, Integrator::extrapolated,
                                      Integrator::runge_kutta};

// Where all links have the same share, it is as if gravity were weaker: of an arm and of a floating tree.
TEST(GravityShare, of_all_links_scales_gravity) {
  for (const double share : {0.0, 0.3, 1.7, -0.5})
    for (const Integrator integrator : integrators)
      for (const auto root : {scenes::RandomOptions::Root::fixed, scenes::RandomOptions::Root::floating}) {
        scenes::RandomOptions options;
        options.root = root, options.soft = scenes::RandomOptions::Soft::never, options.gravity_shares = false;
        options.drives = options.damping = false, options.max_dofs = 8;
        Model weak = scenes::random_model(5, options), balanced = weak;
        weak.gravity *= share;
        for (Link& link : balanced.links) link.gravity = share;
        const auto moved = [&](const Model& model) {
          Batch<double> batch(compile(model, {.dt = 1e-3, .integrator = integrator}), 1, {.threads = 1});
          batch.step(50);
          return physics::state_of(batch);
        };
        const reference::State own = moved(balanced), wanted = moved(weak);
        EXPECT_LE(physics::distance(own.v, wanted.v), share == 0.0 ? 0.0 : 1e-11 * physics::size(wanted.v))
            << share << ' ' << to_string(integrator);
      }
}

// A bar with a bob at each end. The light one has all its weight, the one of twice the mass half of it.
Model scale() {
  Model model;
  model.links = {{"base", {}}};
  Joint& joint = physics::append_link(model, "base", Vector3d::Zero(), Vector3d::UnitY());
  model.links.back() = {"l0", Inertia::box(1.0, {0.1, 0.1, 0.1}, {0.3, 0.0, 0.02})};
  joint.kind = JointKind::continuous;
  Joint weld;
  weld.name = "weld", weld.parent = "l0", weld.child = "heavy";
  weld.origin.translation() = Vector3d(-0.3, 0.0, 0.0);
  model.joints.push_back(weld);
  model.links.push_back({"heavy", Inertia::box(2.0, {0.1, 0.1, 0.1}, {0.0, 0.0, -0.02}), 0.5});
  return model;
}

template <class S>
struct Scale : testing::Test {};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Scale, Precisions);

TYPED_TEST(Scale, hangs_still_at_any_angle_until_a_mass_or_gravity_is_another) {
  for (const Integrator integrator : integrators) {
    SCOPED_TRACE(to_string(integrator));
    const Plan plan =
        compile(scale(), {.integrator = integrator,
                          .per_environment = {Parameter::mass, Parameter::gravity, Parameter::center_of_mass}});
    Batch<TypeParam> batch(plan, 5, {.threads = 1});
    for (int e = 0; e < 5; ++e) batch.positions()(0, e) = static_cast<TypeParam>(1.3 * e);
    batch.parameter(Parameter::mass).col(1) *= 2;  // nothing is out of balance
    batch.parameter(Parameter::gravity)(2, 2) = 5;
    batch.parameter(Parameter::mass)(2, 3) = 3;            // too heavy
    batch.parameter(Parameter::center_of_mass)(6, 4) = 1;  // beside the joint, on the other bob's side
    batch.step(100);
    const double still = sizeof(TypeParam) == 8 ? 1e-13 : 1e-5;
    for (int e = 0; e < 3; ++e) EXPECT_LT(std::abs(batch.velocities()(0, e)), still) << e;
    for (int e = 3; e < 5; ++e) EXPECT_GT(std::abs(batch.velocities()(0, e)), 0.1) << e;
  }
}

// The bar turns fast enough for the audit. What the heavy bob gains by falling comes from its share of gravity.
TEST(GravityShare, keeps_energy_and_the_audit_knows_it) {
  Model model = scale();
  model.links[2].gravity = -4.0;
  model.joints[0].position = 0.4, model.joints[0].velocity = 6.0;
  for (const Integrator integrator : integrators) {
    SCOPED_TRACE(to_string(integrator));
    const double dt = 1.0 / 600;
    Batch<double> batch(compile(model, {.dt = dt, .integrator = integrator}), 1, {.threads = 1});
    const auto energy = [&] { return batch.kinetic_energies()(0, 0) + batch.potential_energies()(0, 0); };
    const double start = energy();
    double lowest = batch.kinetic_energies()(0, 0), highest = lowest, fastest = 0.0;
    for (int step = 0; step < 600; ++step) {
      batch.step();
      const double kinetic = batch.kinetic_energies()(0, 0);
      lowest = std::min(lowest, kinetic), highest = std::max(highest, kinetic);
      fastest = std::max(fastest, std::abs(batch.velocities()(0, 0)));
      const double error = integrator == Integrator::euler ? 0.05 : integrator == Integrator::leapfrog ? 1e-3 : 1e-5;
      EXPECT_LT(std::abs(energy() - start), error * highest) << step;
    }
    EXPECT_GT(highest, 4.0 * lowest);
    EXPECT_GT(dt * fastest, 0.02);
    EXPECT_EQ(batch.faults()[0], Fault::none) << batch.explain_fault(0);
  }
}

// Momentum grows by the weight that is left, whatever the joints do.
TEST(GravityShare, lets_a_floating_tree_fall_by_the_sum_of_its_weights) {
  scenes::RandomOptions options;
  options.root = scenes::RandomOptions::Root::floating, options.coupling_error = false;
  options.soft = scenes::RandomOptions::Soft::never, options.gravity_shares = false;
  for (int seed = 0; seed < 10; ++seed) {
    Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    double weighing = 0.0;
    for (std::size_t l = 0; l < model.links.size(); ++l) {
      model.links[l].gravity = 0.4 * static_cast<double>(l % 5) - 0.5;
      weighing += model.links[l].gravity * model.links[l].inertia.mass;
    }
    const double dt = 1e-7;
    Batch<double> batch(compile(model, physics::settings(Method::direct, 4, 1, dt)), 1, {.threads = 1});
    const Vector3d before = batch.momenta().col(0).tail(3);
    batch.step();
    const Vector3d rate = (Vector3d(batch.momenta().col(0).tail(3)) - before) / dt;
    EXPECT_LT((rate - weighing * model.gravity).norm(), 1e-3 * model.gravity.norm()) << seed;
  }
}

// On the floor and in the air; beside it a block with half of its weight.
TYPED_TEST(Scale, blocks_without_weight_rest_anywhere_and_others_press_by_theirs) {
  using contact_scenes::add_block;
  Model model;
  contact_scenes::add_floor(model, 0.5);
  for (const auto& [name, height] : {std::pair("touching", 0.05), std::pair("hanging", 0.3), std::pair("half", 0.05)}) {
    add_block(model, name, 1.0, {0.1, 0.1, 0.1}, {height, static_cast<double>(model.links.size()), height}, 0.5);
    model.links.back().gravity = 0.0;
    model.contacts.push_back({"floor", name});
  }
  model.links[2].gravity = 0.5;
  Batch<TypeParam> batch(compile(model), 1, {.threads = 1});
  const Eigen::Array<TypeParam, Eigen::Dynamic, 1> start = batch.root_poses().col(0).head(14);
  batch.step(480);
  EXPECT_TRUE((batch.root_poses().col(0).head(14) == start).all());
  const Query query{Quantity::contact_normal_force};
  Eigen::Array<TypeParam, 3, 1> forces;
  batch.read(std::span(&query, 1), {forces.data(), 1, 1});
  EXPECT_EQ(forces[0], 0);
  EXPECT_EQ(forces[1], 0);
  EXPECT_NEAR(forces[2], 0.5 * 9.81, 1e-3);
}

// A tree moves in the share that most of its links have, and only the others cost something.
TEST(GravityShare, is_described_where_it_is_not_one) {
  Model model = scenes::chain8();
  EXPECT_EQ(compile(model).describe().find("of gravity"), std::string::npos);
  for (Link& link : model.links) link.gravity = 0.0;
  const std::string all = compile(model).describe();
  EXPECT_NE(all.find("; 9 links have their own shares of gravity."), std::string::npos) << all;
  EXPECT_EQ(all.find("weights of"), std::string::npos) << all;
  model.links[3].gravity = 0.5;
  const std::string one = compile(model).describe();
  EXPECT_NE(one.find("weights of 1 link that differ"), std::string::npos) << one;
}

}  // namespace
}  // namespace lockstep
