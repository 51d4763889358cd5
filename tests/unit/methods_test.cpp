// The methods follow the equations for mimic joints. SPDX-License-Identifier: Apache-2.0
//
// Equation numbers are those of docs/mathematics.md and of the note that it follows: impulse (12) to (15), N joints
// (17), sweeps (16). With sliders every r is a sum of G^2 / m, so the tests compute expected values by hand.
#include <array>
#include <cmath>

#include "lockstep/error.h"
#include "lockstep/plan.h"
#include "physics.h"
#include "plan/program.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::Array3d;
using Eigen::VectorXd;
using physics::settings;

constexpr double h = 1.0 / 240;

class EachMethod : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(method, EachMethod, testing::ValuesIn(physics::methods), physics::method_name);

// --- one coupling ------------------------------------------------------------------------------------

TEST_P(EachMethod, applies_its_share_of_the_impulse_to_each_joint) {
  const Array3d mass(0.5, 2.0, 0.25), ratio(1.0, -3.0, 0.7), v(1.0, -2.0, 0.3), q(0.2, 0.1, -0.1);
  Model model = physics::sliders({mass[0], mass[1], mass[2]});
  model.couplings = {{"s0", {{"s1", ratio[1]}, {"s2", ratio[2]}}, 0.05, Hard{0.4}}};
  for (int i = 0; i < 3; ++i) model.joints[i].position = q[i], model.joints[i].velocity = v[i];
  StepSettings once = settings(GetParam(), 1, 0);
  once.record_impulses = true;
  Batch<double> batch(compile(model, once), 1, {.threads = 1});
  batch.step();
  // By (17) and (12), the impulse on joint i is dt f G_i.
  const double c = (ratio * q).sum() + 0.05, r = (ratio * ratio / mass).sum();
  const double impulse = -(0.4 * c / h + (ratio * v).sum()) / r;
  EXPECT_NEAR(batch.coupling_impulses()(0, 0), impulse, 1e-12);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(mass[i] * (batch.velocities()(i, 0) - v[i]), ratio[i] * impulse, 1e-12) << i;
    EXPECT_NEAR(batch.positions()(i, 0), q[i] + h * batch.velocities()(i, 0), 1e-15) << i;
  }
}

// C after `steps` steps, for a coupling between two sliders that start at rest with C = 1.
double remaining(double erp, const StepSettings& given, int steps, double* fastest = nullptr) {
  Model model = physics::sliders({0.3, 1.2});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.0, Hard{erp})};
  model.joints[0].position = 1.0;
  Batch<double> batch(compile(model, given), 1, {.threads = 1});
  batch.step(steps);
  if (fastest) *fastest = batch.velocities().abs().maxCoeff();
  return batch.coupling_errors()(0, 0);
}

TEST_P(EachMethod, corrects_the_share_erp_of_an_error_per_step_and_leaves_no_velocity) {
  for (double erp : {0.0, 0.2, 0.5, 1.0})
    for (int velocity_iterations : {1, 3})
      for (int steps : {1, 2, 7, 30}) {
        double fastest = 1.0;
        const double c = remaining(erp, settings(GetParam(), 4, velocity_iterations), steps, &fastest);
        EXPECT_NEAR(c, std::pow(1.0 - erp, steps), 1e-14 * steps) << erp;
        EXPECT_LE(fastest, 1e-12) << erp;  // although corrections move at up to 240 rad/s
      }
}

TEST_P(EachMethod, overshoots_with_an_erp_above_1_by_the_excess) {
  EXPECT_NEAR(remaining(1.5, settings(GetParam(), 1), 1), -0.5, 1e-14);
  EXPECT_NEAR(remaining(1.5, settings(GetParam(), 1), 5), -std::pow(0.5, 5), 1e-14);
}

TEST(Tgs, corrects_the_same_share_of_an_error_for_any_number_of_sub_steps) {
  for (int n : {1, 2, 4, 16, 100})
    for (double erp : {0.2, 0.5, 1.0}) EXPECT_NEAR(remaining(erp, settings(Method::tgs, n), 1), 1.0 - erp, 1e-13) << n;
}

TEST(Tgs, refuses_an_erp_above_1_for_several_sub_steps) {
  EXPECT_THROW(remaining(1.5, settings(Method::tgs, 2), 1), SettingsError);
}

// J is constant, so C shrinks by the factor 1 - erp per step in any posture and at any speed.
TEST(DirectAndReduced, correct_the_share_erp_of_every_error_per_step_of_a_moving_arm) {
  for (Method method : {Method::direct, Method::reduced}) {
    Model model = scenes::chain8();
    for (int i = 0; i < 8; ++i) {
      model.joints[i].position = std::sin(1.0 + 2.0 * i);
      model.joints[i].velocity = 1.0 - 0.3 * i;
    }
    Batch<double> batch(compile(model, settings(method)), 1, {.threads = 1});
    VectorXd expected = batch.coupling_errors().matrix().col(0);
    ASSERT_GT(expected.lpNorm<Eigen::Infinity>(), 1.0);
    for (int step = 0; step < 120; ++step) {
      batch.step();
      expected *= 1.0 - Hard{}.erp;
      ASSERT_LE(physics::distance(batch.coupling_errors().matrix().col(0), expected), 1e-12) << step;
      const auto v = batch.velocities().col(0);  // no correction is left in the velocity
      for (int k : {0, 1, 4, 5}) ASSERT_NEAR(v[k] - v[k + 2], 0.0, 1e-11) << step;
    }
  }
}

// --- couplings that share a joint --------------------------------------------------------------------

// A row of (16). Three sliders have two couplings, which share the middle one.
struct Row {
  Array3d j;
  double erp;
};
const Array3d mass(0.4, 1.0, 0.2), start_q(0.3, -0.1, 0.2), start_v(1.0, 0.0, -2.0), force(0.5, -3.0, 1.0);
const std::array<Row, 2> rows = {Row{{1.0, -2.0, 0.0}, 0.3}, Row{{0.0, 1.0, 0.5}, 0.6}};

Model three_sliders() {
  Model model = physics::sliders({mass[0], mass[1], mass[2]});
  for (int i = 0; i < 3; ++i) {
    model.joints[i].position = start_q[i];
    model.joints[i].velocity = start_v[i];
    model.joints[i].effort = force[i];
  }
  model.couplings = {Coupling::mimic("s0", "s1", -2.0, 0.0, Hard{rows[0].erp}),
                     Coupling::mimic("s1", "s2", 0.5, 0.0, Hard{rows[1].erp})};
  return model;
}

// One visit of (16): afterwards J v = -b.
void visit(const Row& row, double b, Array3d& v) {
  v -= row.j / mass * (b + (row.j * v).sum()) / (row.j * row.j / mass).sum();
}

TEST(Pgs, keeps_positions_and_biases_during_its_sweeps) {
  for (int sweeps : {1, 2, 5}) {
    Array3d v = start_v + h * force / mass;
    for (int n = 0; n < sweeps; ++n)
      for (const Row& row : rows) visit(row, row.erp * (row.j * start_q).sum() / h, v);
    const Array3d q = start_q + h * v;
    for (const Row& row : rows) visit(row, 0.0, v);  // the velocity iteration has no bias
    Batch<double> batch(compile(three_sliders(), settings(Method::pgs, sweeps, 1)), 1, {.threads = 1});
    batch.step();
    EXPECT_LE((batch.positions().col(0) - q).abs().maxCoeff(), 1e-14) << sweeps;
    EXPECT_LE((batch.velocities().col(0) - v).abs().maxCoeff(), 1e-12) << sweeps;
  }
}

TEST(Tgs, updates_positions_and_biases_in_its_sub_steps_and_divides_the_free_motion_among_them) {
  for (int n : {1, 2, 5}) {
    Array3d q = start_q, v = start_v;
    for (int substep = 0; substep < n; ++substep) {
      v += h / n * force / mass;
      for (const Row& row : rows) {
        const double erp = 1.0 - std::pow(1.0 - row.erp, 1.0 / n);
        visit(row, erp * (row.j * q).sum() / (h / n), v);
      }
      q += h / n * v;
    }
    for (const Row& row : rows) visit(row, 0.0, v);
    Batch<double> batch(compile(three_sliders(), settings(Method::tgs, n, 1)), 1, {.threads = 1});
    batch.step();
    EXPECT_LE((batch.positions().col(0) - q).abs().maxCoeff(), 1e-14) << n;
    EXPECT_LE((batch.velocities().col(0) - v).abs().maxCoeff(), 1e-12) << n;
  }
}

// In each sub-step the spring balances the load, so nothing moves at the exact sag. If the first sub-step took all of
// the free motion, this would not be an equilibrium.
TEST(Tgs, keeps_a_loaded_spring_at_rest_where_it_balances) {
  constexpr double kp = 800.0, load = 3.0;
  Model model = physics::sliders({0.5, 0.5});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.0, Spring{kp, 15.0})};
  model.joints[0].effort = load, model.joints[1].effort = -load;
  model.joints[0].position = 0.5 * load / kp, model.joints[1].position = -0.5 * load / kp;
  for (int n : {1, 3, 8, 64}) {
    Batch<double> batch(compile(model, settings(Method::tgs, n)), 1, {.threads = 1});
    batch.step(240);
    EXPECT_NEAR(batch.coupling_errors()(0, 0), load / kp, 1e-14) << n;
    EXPECT_LE(batch.velocities().abs().maxCoeff(), 1e-13) << n;
  }
}

// Gauss-Seidel on a positive definite K + cfm converges to the solution that `direct` finds at once.
TEST(Pgs, converges_to_direct) {
  Model model = scenes::chain8();
  for (int i = 0; i < 8; ++i) model.joints[i].position = 0.3 + 0.01 * i;
  model.couplings[1].softness = Frequency{60.0, 0.5};
  const auto end = [&](const StepSettings& given) {
    Batch<double> batch(compile(model, given), 1, {.threads = 1});
    batch.step(20);
    return physics::state_of(batch);
  };
  const reference::State exact = end(settings(Method::direct));
  double last = 1.0;
  for (int sweeps : {4, 16, 64}) {
    const double error = physics::distance(end(settings(Method::pgs, sweeps, sweeps)).q, exact.q);
    EXPECT_LT(error, 0.5 * last) << sweeps;
    last = error;
  }
  const reference::State swept = end(settings(Method::pgs, 1000, 1000));
  EXPECT_LE(physics::distance(swept.q, exact.q), 1e-11);
  EXPECT_LE(physics::distance(swept.v, exact.v), 1e-9);
}

// --- responses to impulses ---------------------------------------------------------------------------

// Two arms of three links on one base. Each has a coupling.
Model two_arms(bool floating) {
  Model model;
  model.links = {{"base", floating ? physics::link_box(1.0) : Inertia{}}};
  model.roots = {{model.links[0].name, floating}};
  for (int arm = 0; arm < 2; ++arm)
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3d offset(i == 0 ? 0.0 : 0.1, i == 0 ? 0.2 * arm : 0.0, 0.0);
      physics::append_link(model, i == 0 ? "base" : model.links.back().name, offset, Eigen::Vector3d::Unit((i + 1) % 3),
                           0.2 + 0.1 * arm);
      model.joints.back().position = 0.2 + 0.3 * i;
      model.joints.back().velocity = arm == 0 ? 1.0 : 0.0;
    }
  model.couplings = {Coupling::mimic("j0", "j2", -1.0), Coupling::mimic("j3", "j5", -1.0)};
  return model;
}

TEST(Impulses, do_not_cross_a_fixed_root) {
  for (Method method : physics::methods) {
    const Plan plan = compile(two_arms(false), settings(method));
    const Rows<double>& table = program_of(plan).f64.rows;
    for (int b = 0; b < table.blocks.count; ++b)
      for (int i = 0; i < RowBlock::most_rows; ++i)
        for (int k = 0; k < RowBlock::most_columns; ++k) {
          if (table.blocks[b].entry[i][k] < 0) continue;
          EXPECT_EQ(table.blocks[b].row + i, table.blocks[b].column + k);
        }

    // Without its coupling, with an effort and at another place, the first arm changes no bit of the second.
    Model other = two_arms(false);
    other.couplings.erase(other.couplings.begin());
    other.joints[1].effort = 5.0;
    other.joints[2].position = -1.0;
    Batch<double> a(plan, 1, {.threads = 1}), b(compile(other, settings(method)), 1, {.threads = 1});
    a.step(100), b.step(100);
    EXPECT_TRUE((a.positions().bottomRows(3) == b.positions().bottomRows(3)).all()) << to_string(method);
    EXPECT_TRUE((a.velocities().bottomRows(3) == b.velocities().bottomRows(3)).all()) << to_string(method);
  }
}

// r_ij is the change of the velocity of joint i by a unit impulse on joint j. The test gives the impulse as an effort.
TEST(Impulses, have_symmetric_responses_that_cross_a_floating_root_only) {
  for (bool floating : {false, true}) {
    Model model = two_arms(floating);
    model.couplings.clear();
    Batch<double> batch(compile(model, settings(Method::direct)), 7, {.threads = 1});
    for (int j = 0; j < 6; ++j) batch.efforts()(j, j) = 1.0 / h;
    batch.step();
    const Eigen::ArrayXXd v = batch.velocities();
    const Eigen::MatrixXd response = (v.leftCols(6).colwise() - v.col(6)).matrix();
    EXPECT_LE(physics::distance(response, response.transpose().eval()), 1e-11 * physics::size(response));
    const double across = response.topRightCorner(3, 3).cwiseAbs().minCoeff();
    if (floating)
      EXPECT_GT(across, 1e-3);
    else
      EXPECT_TRUE((response.topRightCorner(3, 3).array() == 0.0).all());
    EXPECT_EQ(Eigen::LLT<Eigen::MatrixXd>(response).info(), Eigen::Success) << "not positive definite";
  }
}

// A weight on a spring, in a guide along z.
Model weight_on_spring() {
  Model model = physics::sliders({2.0});
  model.gravity = {0.0, 0.0, -9.81};
  model.joints[0].axis = Eigen::Vector3d::UnitZ();
  model.joints[0].stiffness = 200.0;
  model.joints[0].rest = 0.3;
  return model;
}

// k (q - rest) = effort - m g. The servo pushes with its limit, the spring with more than that.
TEST(Springs, are_outside_of_the_effort_limit) {
  Model model = weight_on_spring();
  model.joints[0].damping = 20.0;
  model.joints[0].effort_limit = 0.5;
  model.joints[0].drive = {.kp = 1e4, .kd = 1.0, .position_target = 10.0};
  for (const Method method : physics::methods) {
    Batch<double> batch(compile(model, settings(method)), 1, {.threads = 1});
    batch.step(4800);
    EXPECT_NEAR(batch.positions()(0, 0), 0.3 + (0.5 - 2.0 * 9.81) / 200.0, 1e-9);
  }
}

// q = sag + (rest - sag) cos(w t) from rest.
TEST(Springs, swing_with_their_frequency) {
  Model model = weight_on_spring();
  const double sag = 0.3 - 2.0 * 9.81 / 200.0, w = std::sqrt(200.0 / 2.0);
  model.joints[0].position = 0.3;
  double before = 0.0;
  for (const int steps : {240, 480}) {
    StepSettings leapfrog = settings(Method::direct, 4, 1, 1.0 / steps);
    leapfrog.integrator = Integrator::leapfrog;
    Batch<double> batch(compile(model, leapfrog), 1, {.threads = 1});
    batch.step(steps);
    const double error = std::abs(batch.positions()(0, 0) - (sag + (0.3 - sag) * std::cos(w)));
    EXPECT_LT(error, 1e-5);
    if (before > 0.0) {
      EXPECT_GT(before / error, 3.5);  // second order or better
    }
    before = error;
  }
}

// However stiff, one step of Euler ends near the rest position.
TEST(Springs, may_be_stiff) {
  Model model = weight_on_spring();
  model.joints[0].stiffness = 1e12;
  Batch<double> batch(compile(model, settings(Method::direct)), 1, {.threads = 1});
  batch.step(10);
  EXPECT_EQ(batch.faulted(), 0);
  EXPECT_NEAR(batch.positions()(0, 0), 0.3, 1e-9);
}

// A soak has found these: with no velocity left to solve for, a leapfrog has no midpoint for the soft row and the
// servos, and no step has a row for a limited servo, also beside contacts.
TEST(LockedMechanism, stands_still_beside_soft_rows_bounds_and_contacts_by_every_engine) {
  Model model = physics::sliders({1.0, 2.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0), Coupling::mimic("s0", "s1", 1.0)};
  model.couplings.push_back({"s0", {{"s1", 1.6}}, 0.1, Spring{10.0, 1.0}});
  for (Joint& joint : model.joints) {
    joint.position = joint.velocity = 0.0;
    joint.lower = -0.5, joint.upper = 0.5, joint.effort_limit = 1.0, joint.friction = 0.1;
    joint.drive.kp = 50.0, joint.drive.kd = 5.0, joint.drive.position_target = 0.3;
  }
  Model on_ground = model;
  Collider ball, ground;
  ball.name = "ball", ball.link = model.joints[1].child, ball.shape = Shape::sphere(0.1);
  ground.name = "ground", ground.shape = Shape::half_space();
  on_ground.colliders = {ground, ball}, on_ground.contacts.push_back({"ground", "ball"});
  for (const Model& locked : {model, on_ground})
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
      const Plan plan = compile(locked, {.integrator = integrator});
      for (const Engine engine : physics::engines(plan)) {
        Batch<double> batch(plan, 3, {.threads = 1, .engine = engine});
        batch.step(20);
        EXPECT_EQ(batch.faulted(), 0);
        EXPECT_EQ(batch.positions().abs().maxCoeff(), 0.0) << to_string(integrator) << ", " << to_string(engine);
      }
    }
}

// Another find of a soak: the drive has no row, so machine code of a leapfrog took nothing for the bounded step.
TEST(LockedMechanism, beside_a_free_joint_is_corrected_by_every_engine_where_its_drive_is_kinematic) {
  Model model = physics::sliders({1.0, 2.0, 0.5});
  model.couplings = {Coupling::mimic("s1", "s0", 1.1), Coupling::mimic("s0", "s1", 2.5, 0.04)};
  model.joints[1].drive.kinematic = true;
  model.joints[0].position = -0.03, model.joints[1].position = 0.1, model.joints[2].velocity = 1.0;
  const double where = -0.04 / (1.0 - 2.5 * 1.1);  // s0 + 2.5 s1 + 0.04 = 0, s1 + 1.1 s0 = 0
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Plan plan = compile(model, {.integrator = integrator});
    ASSERT_EQ(plan.locked_joints().size(), 1u);
    for (const Engine engine : physics::engines(plan)) {
      Batch<double> batch(plan, 3, {.threads = 1, .engine = engine});
      batch.step(240);
      EXPECT_NEAR(batch.positions()(0, 1), where, 1e-9) << to_string(integrator) << ", " << to_string(engine);
      EXPECT_NEAR(batch.positions()(1, 1), -1.1 * where, 1e-9);
    }
  }
}

}  // namespace
}  // namespace lockstep
