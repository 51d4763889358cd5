// Mass matrices, bias forces and Jacobians in independent coordinates: against the reference, Lagrange's equations and
// short steps. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "contract.h"
#include "lockstep/lockstep.h"
#include "physics.h"
#include "reference/couplings.h"
#include "reference/functions.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of environment e, by columns.
MatrixXd matrix_of(const Batch<double>::Array& rows, int e, Eigen::Index height) {
  const VectorXd numbers = rows.col(e).matrix();
  return numbers.reshaped(height, numbers.size() / height);
}

MatrixXd square(const Batch<double>::Array& rows, int e) {
  return matrix_of(rows, e, std::lround(std::sqrt(static_cast<double>(rows.rows()))));
}

// How all velocities move with the coordinates, by the null space of the hard couplings: J S = 0, 1 at coordinates.
MatrixXd shares_by_reference(const reference::Mechanism& mechanism, const VectorXd& q, const std::vector<int>& dofs) {
  const int roots = mechanism.root_velocities(), columns = roots + static_cast<int>(dofs.size());
  std::vector<int> free, placed;
  for (int v = 0; v < roots; ++v) free.push_back(v);
  for (const int dof : dofs) free.push_back(roots + dof);
  for (int v = 0; v < mechanism.velocities(); ++v)
    if (std::find(free.begin(), free.end(), v) == free.end()) placed.push_back(v);
  const reference::Couplings couplings(mechanism, {}, q);
  const MatrixXd j = couplings.velocity_jacobian();
  std::vector<int> hard;
  for (int c = 0; c < couplings.count(); ++c)
    if (is_hard(couplings.softness[static_cast<std::size_t>(c)])) hard.push_back(c);
  MatrixXd s = MatrixXd::Zero(mechanism.velocities(), columns);
  for (int k = 0; k < columns; ++k) s(free[static_cast<std::size_t>(k)], k) = 1.0;
  if (!placed.empty())
    s(placed, Eigen::all) = -j(hard, placed).completeOrthogonalDecomposition().solve(MatrixXd(j(hard, free)));
  return s;
}

void expect_agreement(Batch<double>& batch) {
  const Plan& plan = batch.plan();
  const std::vector<int> dofs = open_coordinate_dofs(plan);
  const auto masses = batch.mass_matrices(), forces = batch.bias_forces();
  const int link = static_cast<int>(plan.model().links.size()) - 1;
  const auto jacobians = batch.reduced_link_jacobians(link);
  for (int e = 0; e < batch.environments(); ++e) {
    const reference::Mechanism mechanism(contract::model_of(batch, e));
    const reference::State state = physics::state_of(batch, e);
    const MatrixXd s = shares_by_reference(mechanism, state.q, dofs);
    const VectorXd armature = mechanism.armature();
    const MatrixXd mass = mechanism.mass_matrix(state) + MatrixXd(armature.asDiagonal());
    const VectorXd bias = mechanism.bias(state) + mass * reference::curved_acceleration(mechanism, state);
    const MatrixXd reduced = s.transpose() * mass * s;
    EXPECT_LT(physics::distance(square(masses, e), reduced), 1e-10 * physics::size(reduced)) << e;
    EXPECT_LT(physics::distance(forces.col(e).matrix(), s.transpose() * bias),
              1e-10 * (1.0 + physics::size(reduced) + physics::size(bias)))
        << e;
    const MatrixXd jacobian = mechanism.jacobian(state, link) * s;
    EXPECT_LT(physics::distance(matrix_of(jacobians, e, 6), jacobian), 1e-10 * (1.0 + physics::size(jacobian))) << e;
  }
}

// Trees that couplings join, floating roots, prismatic joints, tendons, soft couplings, shares of gravity, links that
// fixed joints carry; numbers of each environment.
TEST(Matrices, agree_with_the_reference_for_random_mechanisms) {
  int coupled = 0, soft = 0, floating = 0, tendons = 0;
  for (int seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    scenes::RandomOptions options = scenes::forests();
    options.redundant = false, options.max_tendons = seed % 3;  // ratios that differ would contradict redundant ones
    const Model model = scenes::random_model(static_cast<std::uint64_t>(seed), options);
    const Plan plan = compile(model, {.per_environment = {Parameter::gear_ratio, Parameter::offset, Parameter::mass,
                                                          Parameter::center_of_mass, Parameter::gravity,
                                                          Parameter::armature, Parameter::link_wrench}});
    Batch<double> batch = contract::scattered<double>(plan, 5);
    expect_agreement(batch);
    coupled += open_coordinate_dofs(plan).size() < static_cast<std::size_t>(plan.dofs());
    soft += open_coordinate_dofs(plan).size() > plan.independent_dofs().size();
    floating += !plan.root_names().empty();
    for (const Joint& joint : model.joints) tendons += joint.kind == JointKind::tendon;
  }
  EXPECT_GT(coupled, 20);
  EXPECT_GT(soft, 10);
  EXPECT_GT(floating, 20);
  EXPECT_GT(tendons, 20);
}

Link box(const std::string& name, double mass) {
  return {name, Inertia::box(mass, {0.3, 0.06, 0.1}, {0.15, 0.02, 0.0})};
}

Joint hinge(const std::string& name, const std::string& parent, const Eigen::Vector3d& axis, double x) {
  Joint joint;
  joint.name = name, joint.kind = JointKind::revolute, joint.parent = parent, joint.child = name;
  joint.axis = axis, joint.origin.translation() = Eigen::Vector3d(x, 0.1, 0);
  joint.armature = 0.02;
  return joint;
}

// A chain of four: the third joint is a function of the first, the fourth follows the second and the third, and a
// tendon with an armature is over two of them.
Model curved_chain(bool floats) {
  Model model;
  model.links = {box("base", 2.0), box("a", 0.8), box("b", 0.6), box("c", 0.5), box("d", 0.3)};
  model.joints = {hinge("a", "base", {0, 0, 1}, 0.3), hinge("b", "a", {0, 1, 0}, 0.3), hinge("c", "b", {1, 1, 0}, 0.3),
                  hinge("d", "c", {0, 1, 1}, 0.3)};
  Joint tendon;
  tendon.name = "tendon", tendon.kind = JointKind::tendon, tendon.armature = 0.3;
  model.joints.push_back(tendon);
  model.couplings = {Coupling::cam("c", "a", Polynomial{{0.1, 0.8, 0.3, 0.1}}),
                     {"d", {{"b", -0.5}, {"c", 1.2}}, 0.05, Hard{}},
                     {"tendon", {{"a", -1.0}, {"b", 0.7}}, 0.0, Hard{}}};
  model.joints[0].lower = -0.8, model.joints[0].upper = 0.8;  // where the function has one direction
  model.roots.resize(1);
  model.roots[0].link = "base", model.roots[0].floating = floats;
  model.add_site("tip", "d").pose.translation() = Eigen::Vector3d(0.3, 0.0, 0.1);
  return model;
}

// Coordinates and, if it floats, the root, that differ.
Batch<double> moving_chains(const Plan& plan, int environments) {
  Batch<double> batch(plan, environments, {.threads = 1});
  std::mt19937 random(5);
  std::uniform_real_distribution<double> number(-0.5, 0.5);
  for (int e = 0; e < environments; ++e) {
    for (const int dof : open_coordinate_dofs(plan)) batch.positions()(dof, e) = number(random);
    for (const int dof : open_coordinate_dofs(plan)) batch.velocities()(dof, e) = 4.0 * number(random);
    for (Eigen::Index k = 0; k < batch.root_velocities().rows(); ++k)
      batch.root_velocities()(k, e) = 3.0 * number(random);
    for (Eigen::Index k = 0; k < batch.root_poses().rows(); ++k) batch.root_poses()(k, e) = number(random);
  }
  EXPECT_TRUE(batch.project().empty());
  return batch;
}

TEST(Matrices, agree_with_the_reference_beside_functions) {
  for (const bool floats : {false, true}) {
    const Plan plan = compile(curved_chain(floats));
    Batch<double> batch = moving_chains(plan, 9);
    expect_agreement(batch);
  }
}

// c = dM/dt z - 1/2 d(z^T M z)/dq + dV/dq, by centred differences of the same mechanism at other positions.
TEST(Matrices, keep_lagranges_equations) {
  const Plan plan = compile(curved_chain(false));
  const std::vector<int> dofs = open_coordinate_dofs(plan);
  const auto n = static_cast<Eigen::Index>(dofs.size());
  constexpr int environments = 6;
  Batch<double> batch = moving_chains(plan, environments);
  MatrixXd z(n, environments);
  for (Eigen::Index k = 0; k < n; ++k) z.row(k) = batch.velocities().row(dofs[static_cast<std::size_t>(k)]).matrix();
  const auto masses = batch.mass_matrices(), forces = batch.bias_forces(), energies = batch.kinetic_energies();
  MatrixXd expected = MatrixXd::Zero(n, environments);
  for (Eigen::Index k = 0; k < n; ++k) {
    constexpr double step = 1e-5;
    Batch<double>::Array mass[2], potential[2];
    for (const int side : {0, 1}) {
      batch.positions().row(dofs[static_cast<std::size_t>(k)]) += (side == 0 ? 1 : -2) * step;
      batch.project();
      mass[side] = batch.mass_matrices(), potential[side] = batch.potential_energies();
    }
    batch.positions().row(dofs[static_cast<std::size_t>(k)]) += step;
    for (int e = 0; e < environments; ++e) {
      const MatrixXd slope = (square(mass[0], e) - square(mass[1], e)) / (2.0 * step);
      expected.col(e) += slope * z.col(e) * z(k, e);
      expected(k, e) += (potential[0](0, e) - potential[1](0, e)) / (2.0 * step) - 0.5 * z.col(e).dot(slope * z.col(e));
    }
  }
  for (int e = 0; e < environments; ++e) {
    EXPECT_NEAR(0.5 * z.col(e).dot(square(masses, e) * z.col(e)), energies(0, e), 1e-12);
    EXPECT_LT(physics::distance(forces.col(e).matrix(), expected.col(e)), 1e-7);
  }
}

// M dz/dt + c is what efforts on the coordinates are, for a short step. Roots turn, so their rates are those of the
// twist's components.
TEST(Matrices, say_what_a_short_step_does) {
  for (const bool floats : {false, true}) {
    constexpr double h = 1e-7;
    StepSettings settings;
    settings.dt = h, settings.integrator = Integrator::euler;
    settings.ignore.position_limits.all = true;
    const Plan plan = compile(curved_chain(floats), settings);
    const std::vector<int> dofs = open_coordinate_dofs(plan);
    Batch<double> batch = moving_chains(plan, 8);
    const auto masses = batch.mass_matrices(), forces = batch.bias_forces();
    const auto velocities = [&](int e) {
      VectorXd z(batch.root_velocities().rows() + static_cast<Eigen::Index>(dofs.size()));
      z.head(batch.root_velocities().rows()) = batch.root_velocities().col(e).matrix();
      for (std::size_t k = 0; k < dofs.size(); ++k)
        z[batch.root_velocities().rows() + static_cast<Eigen::Index>(k)] = batch.velocities()(dofs[k], e);
      return z;
    };
    std::vector<VectorXd> before;
    for (int e = 0; e < 8; ++e) before.push_back(velocities(e));
    for (std::size_t k = 0; k < dofs.size(); ++k)
      for (int e = 0; e < 8; ++e) batch.efforts()(dofs[k], e) = std::sin(1.0 + e + 3.0 * static_cast<double>(k));
    batch.step();
    for (int e = 0; e < 8; ++e) {
      const VectorXd rate = (velocities(e) - before[static_cast<std::size_t>(e)]) / h;
      VectorXd effort = VectorXd::Zero(rate.size());
      for (std::size_t k = 0; k < dofs.size(); ++k)
        effort[batch.root_velocities().rows() + static_cast<Eigen::Index>(k)] = batch.efforts()(dofs[k], e);
      EXPECT_LT(physics::distance(square(masses, e) * rate + forces.col(e).matrix(), effort), 2e-4) << floats << e;
    }
  }
}

// Beside functions and tendons: a step of Euler changes the velocities by h M^-1 times the efforts.
TEST(Matrices, are_what_linearize_finds_beside_functions_and_tendons) {
  constexpr double h = 1e-3;
  StepSettings settings;
  settings.dt = h, settings.integrator = Integrator::euler;
  const Plan plan = compile(curved_chain(false), settings);
  Batch<double> batch = moving_chains(plan, 5);
  ASSERT_EQ(coordinate_dofs(plan), plan.independent_dofs());
  const auto derivatives = batch.linearize(EnvironmentSet::all(), {.inputs = ActionKind::effort});
  const auto masses = batch.mass_matrices();
  const auto n = static_cast<Eigen::Index>(coordinate_dofs(plan).size());
  for (int e = 0; e < 5; ++e) {
    const MatrixXd by_effort = derivatives[static_cast<std::size_t>(e)].state_by_input.bottomRows(n);
    const MatrixXd expected = h * square(masses, e).inverse();
    EXPECT_LT(physics::distance(by_effort, expected), 1e-7 * physics::size(expected));
  }
}

TEST(Matrices, have_jacobians_that_give_the_velocities_of_frames) {
  const Plan plan = compile(curved_chain(true));
  const std::vector<int> dofs = open_coordinate_dofs(plan);
  Batch<double> batch = moving_chains(plan, 4);
  const std::vector<int> some = {2, 0};
  const auto jacobians = batch.reduced_site_jacobians(plan.site("tip"), some);
  const Query query{Quantity::site_velocity, {plan.site("tip")}};
  Batch<double>::Array velocity(6, 4);
  batch.read(std::span(&query, 1), {velocity.data(), 4, 1});
  for (int i = 0; i < 2; ++i) {
    const int e = some[static_cast<std::size_t>(i)];
    VectorXd z(6 + static_cast<Eigen::Index>(dofs.size()));
    z.head(6) = batch.root_velocities().col(e).matrix();
    for (std::size_t k = 0; k < dofs.size(); ++k) z[6 + static_cast<Eigen::Index>(k)] = batch.velocities()(dofs[k], e);
    EXPECT_LT(physics::distance(matrix_of(jacobians, i, 6) * z, velocity.col(e).matrix()), 1e-10);
  }
}

TEST(Matrices, open_loops) {
  Model model;
  model.links = {box("base", 1.0), box("a", 0.8), box("b", 0.6)};
  model.joints = {hinge("a", "base", {0, 0, 1}, 0.0), hinge("b", "a", {0, 0, 1}, 0.3)};
  model.joints[0].position = 0.4, model.joints[1].position = 0.3;
  const Plan open = compile(model);
  Loop& loop = model.loops.emplace_back();
  loop.name = "rod", loop.first = "b", loop.kind = LoopKind::point;
  Pose end = Pose::Identity();
  end.translation() = Eigen::Vector3d(0.3, 0, 0);
  loop.first_pose = end;
  model.add_site("end", "b", end);
  Batch<double> free(open, 1, {.threads = 1});
  const Plan probe = compile([&] {
    Model m = model;
    m.loops.clear();
    return m;
  }());
  Batch<double> placed(probe, 1, {.threads = 1});
  loop.second_pose.translation() = placed.site_positions(0).col(0).matrix();
  const Plan plan = compile(model);
  EXPECT_TRUE(coordinate_dofs(plan).size() < open_coordinate_dofs(plan).size());
  Batch<double> closed(plan, 1, {.threads = 1});
  EXPECT_TRUE(closed.mass_matrices().isApprox(free.mass_matrices(), 1e-12));
  EXPECT_TRUE(closed.bias_forces().isApprox(free.bias_forces(), 1e-12));
}

TEST(Matrices, have_the_same_bits_for_any_batch_and_precision_close) {
  const Plan plan = compile(curved_chain(true));
  Batch<double> all = moving_chains(plan, 40);
  const auto masses = all.mass_matrices(), forces = all.bias_forces();
  Batch<double> two(plan, 2, {.threads = 2});
  for (const int e : {0, 17, 39}) {
    two.restore(all.save(std::vector<int>{e}), std::vector<int>{1});
    EXPECT_TRUE((two.mass_matrices({1}) == masses.col(e)).all());
    EXPECT_TRUE((two.bias_forces({1}) == forces.col(e)).all());
  }
  Batch<float> single(plan, 1, {.threads = 1});
  single.positions() = all.positions().col(3).cast<float>(),
  single.velocities() = all.velocities().col(3).cast<float>();
  single.root_poses() = all.root_poses().col(3).cast<float>();
  single.root_velocities() = all.root_velocities().col(3).cast<float>();
  EXPECT_TRUE(single.mass_matrices().cast<double>().isApprox(masses.col(3), 1e-5));
  EXPECT_TRUE(single.bias_forces().cast<double>().isApprox(forces.col(3), 1e-4));
  const std::vector<std::byte> before = all.save();
  (void)all.mass_matrices(), (void)all.bias_forces(), (void)all.reduced_site_jacobians(0);
  EXPECT_EQ(all.save(), before);
}

TEST(Matrices, refuse_free_followers_and_unknown_frames) {
  Model model = curved_chain(false);
  model.couplings.erase(model.couplings.begin());
  const Plan plan = compile(model, {.per_environment = {Parameter::coupling_switch}});
  Batch<double> batch(plan, 3, {.threads = 1});
  EXPECT_THROW(batch.reduced_link_jacobians(5), UsageError);
  EXPECT_THROW(batch.reduced_site_jacobians(-1), UsageError);
  EXPECT_THROW(batch.mass_matrices({3}), UsageError);
  batch.parameter(Parameter::coupling_switch)(0, 1) = 0.0;
  EXPECT_THROW(batch.mass_matrices(), UsageError);
  EXPECT_THROW(batch.bias_forces({1}), UsageError);
  EXPECT_THROW(batch.reduced_link_jacobians(0), UsageError);
  EXPECT_EQ(batch.mass_matrices({0, 2}).cols(), 2);
}

}  // namespace
}  // namespace lockstep
