// Simbody and MuJoCo as oracles of the exact motion. SPDX-License-Identifier: Apache-2.0
//
// The kernels and the reference of this project might share a mistake in mechanics. Simbody and MuJoCo get the same
// scenes from the same Model, but share neither equations nor code with this project. The tests estimate the error of
// each engine from several of its runs, and allow a difference of the sum of these errors.
#include <gtest/gtest.h>

#include <cmath>

#include "lockstep/batch.h"
#include "peers/peer.h"
#include "reference/couplings.h"
#include "reference/truth.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int rows = 240;  // of a motion, besides the start: one every 1/240 s over the first second

// A bound of the measured difference.
struct Bound {
  const char* scene;
  double rms;  // over all joints and the first second, rad
};

struct Motion {
  MatrixXd positions;  // [row][dof]
  double error;        // estimate of the largest error, rad
};

double farthest(const MatrixXd& a, const MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(); }
double rms(const MatrixXd& a, const MatrixXd& b) { return (a - b).norm() / std::sqrt(static_cast<double>(a.size())); }

// The positions at all rows; step(row) advances from row to row + 1.
template <class Positions, class Step>
MatrixXd recorded(Positions&& positions, Step&& step) {
  const VectorXd start = positions();
  MatrixXd result(rows + 1, start.size());
  result.row(0) = start;
  for (int row = 1; row <= rows; ++row) {
    step(row - 1);
    result.row(row) = positions();
  }
  return result;
}

MatrixXd stepped(const scenes::Scene& scene, int steps_per_row) {
  const StepSettings settings{
      .dt = 1.0 / (rows * steps_per_row), .integrator = Integrator::extrapolated, .stage_inputs = true};
  Batch<double> batch(compile(scene.model, settings), 1, {.threads = 1});
  const std::vector<double> times = batch.plan().stage_times();
  const int dofs = batch.plan().dofs();
  const auto step = [&](int row) {
    for (int n = row * steps_per_row; n < (row + 1) * steps_per_row; ++n) {
      for (std::size_t i = 0; i < times.size(); ++i)
        batch.position_targets().col(0).segment(static_cast<int>(i) * dofs, dofs) =
            scene.targets((n + times[i]) * settings.dt).array();
      batch.step();
    }
  };
  return recorded([&] { return VectorXd(batch.positions().col(0).matrix()); }, step);
}

// Steps of 1/1920 s. With a method of third order, half the step has an eighth of the error, so the error is a seventh
// of what halving the step changed. The estimate is twice that, because drives that are faster than a step (2e4 /s in
// gripper13) reduce the order towards two, the order of the leapfrogs that are extrapolated.
Motion own_motion(const scenes::Scene& scene) {
  const MatrixXd fine = stepped(scene, 8);
  return {fine, 2.0 * farthest(fine, stepped(scene, 4)) / 7.0};
}

#ifdef LOCKSTEP_PEER_SIMBODY

MatrixXd simbody_positions(const scenes::Scene& scene, double accuracy) {
  const auto peer = peers::simbody_motion(scene.model, 1.0 / rows, scene.targets, accuracy);
  const MatrixXd positions = recorded([&] { return peer->positions(); }, [&](int) { peer->step(); });
  EXPECT_FALSE(peer->failed());
  return positions;
}

// Step control keeps the error of each step at `accuracy`. With a method of fourth order, steps are proportional to the
// fifth root of the accuracy, so errors over a given time are proportional to its power 4/5. The estimate is twice what
// follows from that, because steps vary.
Motion simbody_motion(const scenes::Scene& scene) {
  const double coarser = 100.0, accuracy = 1e-10;
  const MatrixXd fine = simbody_positions(scene, accuracy);
  return {fine, 2.0 * farthest(fine, simbody_positions(scene, coarser * accuracy)) / (std::pow(coarser, 0.8) - 1.0)};
}

class Simbody : public testing::TestWithParam<Bound> {};

TEST_P(Simbody, computes_the_same_motion) {
  const scenes::Scene scene = scenes::scene(GetParam().scene);
  const Motion own = own_motion(scene), other = simbody_motion(scene);
  const double far = farthest(own.positions, other.positions);
  RecordProperty("farthest_nrad", std::to_string(1e9 * far));
  EXPECT_LE(far, own.error + other.error) << own.error << " ours, " << other.error << " Simbody's";
  EXPECT_LE(rms(own.positions, other.positions), GetParam().rms);
}

INSTANTIATE_TEST_SUITE_P(oracles, Simbody,
                         testing::Values(Bound{"chain8", 3e-9}, Bound{"gripper13", 3e-8}, Bound{"chain32", 1e-6}),
                         [](const auto& info) { return std::string(info.param.scene); });

#endif

#ifdef LOCKSTEP_PEER_MUJOCO

// gripper13 is not among the scenes of MuJoCo. Its Runge-Kutta 4 is explicit in the servos, so it diverges with steps
// longer than 2.8 / 2e4 s. It holds targets over a step, so with shorter steps it converges to first order only.

std::unique_ptr<peers::Peer> stiff_mujoco(const Model& model, double dt) {
  for (const peers::Contender& contender : peers::mujoco_contenders())
    if (contender.settings == "stiff: RK4, Newton once, dense") return contender.make(model, dt, 1);
  throw std::logic_error("there is no MuJoCo contender with stiff couplings");
}

MatrixXd mujoco_positions(const scenes::Scene& scene, int steps_per_row) {
  const auto peer = stiff_mujoco(scene.model, 1.0 / (rows * steps_per_row));
  const auto step = [&](int) {
    for (int n = 0; n < steps_per_row; ++n) peer->step();
  };
  const MatrixXd positions = recorded([&] { return peer->positions(); }, step);
  EXPECT_FALSE(peer->failed());
  return positions;
}

// The couplings of MuJoCo are critically damped springs with a time constant of two steps h (solref "2h 1"). They start
// without force. By this row they have reached it: at h = 1/1920 s all but exp(-96) of it.
constexpr int settled = 24;
MatrixXd after_settling(const MatrixXd& positions) { return positions.bottomRows(rows + 1 - settled); }

class Mujoco : public testing::TestWithParam<Bound> {
 protected:
  const scenes::Scene scene_ = scenes::scene(GetParam().scene);
};

// The springs yield in proportion to the square of the step (see below), so the error is of second order although
// Runge-Kutta 4 is of fourth.
TEST_P(Mujoco, converges_to_the_same_motion_with_the_square_of_the_step) {
  const Motion own = own_motion(scene_);
  EXPECT_LE(rms(mujoco_positions(scene_, 1), own.positions), GetParam().rms);

  const MatrixXd whole = after_settling(mujoco_positions(scene_, 8)),
                 half = after_settling(mujoco_positions(scene_, 16)),
                 quarter = after_settling(mujoco_positions(scene_, 32));
  EXPECT_NEAR(std::log2(farthest(whole, half) / farthest(half, quarter)), 2.0, 0.15);
  // Extrapolation removes the second order. The estimate is twice that of a third-order error, as above.
  const MatrixXd coarse = (4.0 * half - whole) / 3.0, fine = (4.0 * quarter - half) / 3.0;
  const double error = 2.0 * farthest(coarse, fine) / 7.0, far = farthest(fine, after_settling(own.positions));
  RecordProperty("farthest_nrad", std::to_string(1e9 * far));
  EXPECT_LE(far, own.error + error) << own.error << " ours, " << error << " MuJoCo's";
}

struct Forces {
  MatrixXd from_errors, exact;  // [row][coupling], N m: from C, and those of the exact motion at the same state
};

// A spring with impedance d = 0.9999 yields by (1 - d) (2 h)^2 w f under the force f that the coupling needs. Here w is
// the sum of (M^-1)_jj at q = 0 over the joints of the coupling. This follows from MuJoCo's stiffness, 1 / (2 h d)^2
// per inertia and impedance, and its compliance, (1 - d) / d times w.
Forces mujoco_forces(const Model& model, int steps_per_row) {
  const reference::Mechanism mechanism(model);
  const reference::Couplings couplings(mechanism);
  const reference::Inputs inputs = mechanism.initial_inputs();
  const MatrixXd jacobian = couplings.velocity_jacobian();
  reference::State zero = mechanism.initial_state();
  zero.q.setZero();
  const double dt = 1.0 / (rows * steps_per_row);
  const VectorXd weights = jacobian.cwiseAbs() * mechanism.mass_matrix(zero).inverse().diagonal();
  const VectorXd compliances = (1.0 - 0.9999) * 4.0 * dt * dt * weights;

  const auto peer = stiff_mujoco(model, dt);
  Forces forces{MatrixXd(rows, couplings.count()), MatrixXd(rows, couplings.count())};
  for (int row = 0; row < rows; ++row) {
    for (int n = 0; n < steps_per_row; ++n) peer->step();
    const reference::State state = *peer->state();
    const VectorXd missing = mechanism.mass_matrix(state) * reference::acceleration(mechanism, state, inputs) +
                             mechanism.bias(state) - mechanism.joint_forces(state, inputs);
    forces.from_errors.row(row) = -couplings.error(state.q).cwiseQuotient(compliances);
    forces.exact.row(row) = jacobian.transpose().colPivHouseholderQr().solve(missing);
  }
  return {forces.from_errors.bottomRows(rows - settled), forces.exact.bottomRows(rows - settled)};
}

// The dampers of the springs make C lag by twice the time constant, 4 h. Extrapolation removes this error of first
// order and leaves the second.
TEST_P(Mujoco, has_coupling_errors_that_follow_from_the_forces_of_the_exact_motion) {
  const Forces whole = mujoco_forces(scene_.model, 16), half = mujoco_forces(scene_.model, 32),
               quarter = mujoco_forces(scene_.model, 64);
  const MatrixXd coarse = 2.0 * half.from_errors - whole.from_errors,
                 fine = 2.0 * quarter.from_errors - half.from_errors;
  const double far = farthest(fine, quarter.exact), error = 2.0 * farthest(coarse, fine) / 3.0;
  RecordProperty("farthest_uNm", std::to_string(1e6 * far));
  RecordProperty("largest_uNm", std::to_string(1e6 * quarter.exact.cwiseAbs().maxCoeff()));
  EXPECT_LE(far, error);
  EXPECT_NEAR(std::log2(farthest(coarse, quarter.exact) / far), 2.0, 0.15);
}

INSTANTIATE_TEST_SUITE_P(oracles, Mujoco, testing::Values(Bound{"chain8", 1.5e-6}, Bound{"chain32", 7e-6}),
                         [](const auto& info) { return std::string(info.param.scene); });

#endif

}  // namespace
}  // namespace lockstep
