// The readbacks of a batch agree with the reference. SPDX-License-Identifier: Apache-2.0
//
// The tests use random trees with fixed links, links on the fixed base, displaced roots and joints in any order, and
// environments with different masses and gravity. Rounding is far below the tolerance of 1e-10.
#include <functional>

#include "contract.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using reference::Mechanism;
using reference::State;

constexpr double close = 1e-10;
constexpr int environments = 3, seeds = 100;

void expect_close(const MatrixXd& ours, const MatrixXd& theirs, const char* what) {
  EXPECT_LE(physics::distance(ours, theirs), close * std::max(1.0, physics::size(theirs))) << what;
}

// Calls check(batch, environment, mechanism of that environment, its state) after two steps.
void for_random_environments(const std::function<void(Batch<double>&, int, const Mechanism&, const State&)>& check) {
  for (std::uint64_t seed = 0; seed < seeds && !testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const ParameterSet fields = {Parameter::mass, Parameter::gravity, Parameter::offset};
    const Plan plan = compile(scenes::random_model(seed), contract::settings(Method::direct, fields));
    Batch<double> batch =
        contract::scattered<double>(plan, environments, physics::by_turns(plan, static_cast<int>(seed)));
    batch.step(2);
    for (int e = 0; e < environments; ++e) {
      SCOPED_TRACE(e);
      check(batch, e, Mechanism(contract::model_of(batch, e)), physics::state_of(batch, e));
    }
  }
}

TEST(Readback, reports_poses_and_velocities_of_links) {
  for_random_environments([](Batch<double>& batch, int e, const Mechanism& mechanism, const State& state) {
    const std::vector<Eigen::Isometry3d> poses = mechanism.link_poses(state);
    for (int link = 0; link < mechanism.links(); ++link) {
      const VectorXd pose = batch.link_poses(link).col(e).matrix();
      ASSERT_EQ(pose.size(), 7);
      EXPECT_NEAR(pose.tail(4).norm(), 1.0, 1e-15 * 4);
      const Eigen::Quaterniond turn(pose[3], pose[4], pose[5], pose[6]);
      expect_close(pose.head(3), poses[static_cast<std::size_t>(link)].translation(), "position");
      expect_close(turn.toRotationMatrix(), poses[static_cast<std::size_t>(link)].linear(), "rotation");
      expect_close(batch.link_velocities(link).col(e).matrix(), mechanism.link_velocity(state, link), "velocity");
    }
  });
}

TEST(Readback, reports_positions_and_jacobians_of_sites) {
  for_random_environments([](Batch<double>& batch, int e, const Mechanism& mechanism, const State& state) {
    for (int site = 0; site < 2; ++site) {
      expect_close(batch.site_positions(site).col(e).matrix(), mechanism.site_position(state, site), "position");
      const VectorXd packed = batch.site_jacobians(site).col(e).matrix();
      ASSERT_EQ(packed.size(), 6 * mechanism.velocities());
      const MatrixXd jacobian = packed.reshaped(6, mechanism.velocities());
      expect_close(jacobian, mechanism.site_jacobian(state, site), "Jacobian");
    }
  });
}

TEST(Readback, reports_energies_and_momenta) {
  for_random_environments([](Batch<double>& batch, int e, const Mechanism& mechanism, const State& state) {
    EXPECT_NEAR(batch.kinetic_energies()(0, e), mechanism.kinetic_energy(state),
                close * std::max(1.0, mechanism.kinetic_energy(state)));
    // A fixed root and the links fixed to it have potential energy as well.
    const double energy = mechanism.potential_energy(state);
    EXPECT_NEAR(batch.potential_energies()(0, e), energy, close * std::max(1.0, std::abs(energy)));
    expect_close(batch.momenta().col(e).matrix(), mechanism.momentum(state), "momentum");
  });
}

TEST(Readback, reports_coupling_errors) {
  for_random_environments([](Batch<double>& batch, int e, const Mechanism& mechanism, const State& state) {
    expect_close(batch.coupling_errors().col(e).matrix(), reference::Couplings(mechanism).error(state.q), "C");
  });
}

// Moves one environment a little along one generalised velocity; those of a root are in its own axes.
void displace(Batch<double>& batch, int environment, int velocity, double amount) {
  const int of_roots = static_cast<int>(batch.root_velocities().rows());
  if (velocity >= of_roots) {
    batch.positions()(velocity - of_roots, environment) += amount;
    return;
  }
  auto pose = batch.root_poses().col(environment).segment<7>(7 * (velocity / 6));
  velocity %= 6;
  const Vector3d position = pose.head<3>();
  const Eigen::Quaterniond orientation(pose[3], pose[4], pose[5], pose[6]);
  if (velocity >= 3) {
    const Vector3d moved = position + orientation * Vector3d(amount * Vector3d::Unit(velocity - 3));
    for (int k = 0; k < 3; ++k) pose[k] = moved[k];
    return;
  }
  const Eigen::AngleAxisd small(amount, Vector3d::Unit(velocity));
  const Eigen::Quaterniond turn = orientation * small;
  pose[3] = turn.w(), pose[4] = turn.x(), pose[5] = turn.y(), pose[6] = turn.z();
}

// The error of central differences with step h is h^2 / 6 times a third derivative, plus the rounding of positions
// divided by h. Third derivatives grow with the reach of the mechanism, some metres.
TEST(Readback, reports_jacobians_that_are_the_derivatives_of_site_positions) {
  constexpr double h = 1e-5, tolerance = 10.0 * (h * h + 1e-15 / h);
  for (std::uint64_t seed = 0; seed < 40 && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const Plan plan = compile(scenes::random_model(seed), physics::settings(Method::direct));
    const int velocities = plan.dofs() + 6 * static_cast<int>(plan.root_names().size());
    Batch<double> batch(plan, 2 * velocities, {.threads = 1});
    for (int e = 0; e < batch.environments(); ++e) contract::scatter(batch, e, seed);
    const VectorXd packed = batch.site_jacobians(0).col(0).matrix();
    for (int i = 0; i < velocities; ++i) {
      displace(batch, 2 * i, i, h);
      displace(batch, 2 * i + 1, i, -h);
    }
    const auto positions = batch.site_positions(0);
    for (int i = 0; i < velocities; ++i) {
      const Vector3d slope = (positions.col(2 * i) - positions.col(2 * i + 1)).matrix() / (2.0 * h);
      EXPECT_LE(physics::distance(slope, packed.segment<3>(6 * i + 3)), tolerance) << "velocity " << i;
    }
  }
}

class CouplingImpulses : public testing::TestWithParam<Method> {};

// For swept, solved and eliminated couplings, and also for redundant ones, which take no impulse.
TEST_P(CouplingImpulses, are_those_of_the_last_step) {
  int eliminated = 0;
  for (std::uint64_t seed = 0; seed < seeds && !HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    const Plan plan = compile(scenes::random_model(seed), contract::settings(GetParam(), {Parameter::mass}));
    eliminated += static_cast<int>(plan.eliminated_dofs().size());
    Batch<double> batch =
        contract::scattered<double>(plan, environments, physics::by_turns(plan, static_cast<int>(seed)));
    batch.step(2);
    std::vector<Model> before;
    for (int e = 0; e < environments; ++e) before.push_back(contract::model_of(batch, e));
    batch.step();
    const MatrixXd impulses = batch.coupling_impulses().matrix();
    ASSERT_EQ(impulses.rows(), plan.couplings());
    for (int e = 0; e < environments; ++e) {
      const Mechanism mechanism(before[static_cast<std::size_t>(e)]);
      const reference::Step step =
          reference::step(mechanism, plan.settings(), mechanism.initial_state(), mechanism.initial_inputs());
      MatrixXd k = step.stage.response;
      for (Eigen::Index r = 0; r < k.rows(); ++r) k(r, r) += step.stage.rows[static_cast<std::size_t>(r)].cfm;
      const double kappa = physics::condition(step.stage.implicit) * physics::condition(k);
      const double rounding = std::max(close, mechanism.velocities() * physics::epsilon * kappa);
      const double momentum = physics::size(step.stage.implicit) * std::max(1.0, physics::size(step.state.v));
      const double scale = std::max(momentum, physics::size(step.impulses));
      EXPECT_LE(physics::distance(impulses.col(e), step.impulses), rounding * scale);
      for (int c : plan.redundant_couplings()) EXPECT_EQ(impulses(c, e), 0.0);
    }
  }
  EXPECT_EQ(eliminated > 0, GetParam() == Method::reduced);
}

INSTANTIATE_TEST_SUITE_P(method, CouplingImpulses, testing::ValuesIn(physics::methods), physics::method_name);

}  // namespace
}  // namespace lockstep
