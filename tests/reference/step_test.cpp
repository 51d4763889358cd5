// Couplings and methods of the reference agree with theory. SPDX-License-Identifier: Apache-2.0
#include "reference/step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "lockstep/error.h"
#include "reference/truth.h"
#include "scenes/scenes.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr Method every_method[] = {Method::pgs, Method::tgs, Method::direct, Method::reduced};

double difference(const MatrixXd& a, const MatrixXd& b) { return a.size() == 0 ? 0.0 : (a - b).cwiseAbs().maxCoeff(); }

StepSettings with(Method method, double dt = 1.0 / 240, int iterations = 4, int velocity_iterations = 1) {
  StepSettings settings;
  settings.method = method, settings.dt = dt;
  settings.iterations = iterations, settings.velocity_iterations = velocity_iterations;
  return settings;
}

// Two coupled bodies of 1 kg that slide along z without gravity: C = q_A - q_B, so r = 1/m_A + 1/m_B = 2.
Model two_sliders(const Softness& softness, double error = 0.0, double velocity = 0.0) {
  Model model;
  model.gravity.setZero();
  const Inertia body = Inertia::box(1.0, {0.1, 0.1, 0.1}, {0, 0, 0});
  model.links = {{"base", {}}, {"a", body}, {"b", body}};
  Joint joint;
  joint.kind = JointKind::prismatic, joint.parent = "base", joint.axis = Vector3d::UnitZ();
  joint.name = "A", joint.child = "a", joint.position = error, joint.velocity = velocity;
  model.joints.push_back(joint);
  joint.name = "B", joint.child = "b", joint.position = joint.velocity = 0.0;
  model.joints.push_back(joint);
  model.couplings = {Coupling::mimic("A", "B", -1.0, 0.0, softness)};
  return model;
}

// One step from the model's state with the model's inputs.
Step once(const Mechanism& mechanism, const StepSettings& settings) {
  return step(mechanism, settings, mechanism.initial_state(), mechanism.initial_inputs());
}

double relative(const State& state) { return state.q[0] - state.q[1]; }

// ---------------------------------------------------------------- softness

TEST(ReferenceSoftness, literal_row_of_18_hardens_with_every_visit_and_a_row_with_memory_gives_21) {
  const double r = 2.0, dt = 0.01, C = 0.1, v = 0.5, mu = 40.0, zeta = 1.0;
  const double kp = mu * mu / r, kd = 2.0 * mu * zeta / r;
  const double implicit = -(C * kp * dt + v * dt * (dt * kp + kd)) / (1.0 + r * dt * (dt * kp + kd));  // (21)
  EXPECT_NEAR(implicit, -0.531, 5e-4);

  const Mechanism sliders(two_sliders(Frequency{mu, zeta}, C, v));
  const Stage stage(sliders, dt, sliders.initial_state(), sliders.initial_inputs());
  EXPECT_NEAR(stage.response(0, 0), r, 1e-15);
  const double literal[] = {-0.531, -0.801, -1.010, -1.078};
  for (int k = 0; k < 4; ++k) {
    const StepSettings settings = with(Method::pgs, dt, 1 << k, 0);
    EXPECT_NEAR(literal_18(stage, settings).impulses[0], literal[k], 5e-4);
    EXPECT_NEAR(pgs(stage, settings).impulses[0], implicit, 1e-14);
  }
  for (const Method method : {Method::direct, Method::reduced})
    EXPECT_NEAR(once(sliders, with(method, dt)).impulses[0], implicit, 1e-14);
}

// Backward Euler turns a mode exp(s t) into (1 - h s)^-n. From that follow the measured frequency and damping ratio for
// 2 Hz and 0.1 with steps of 1/240 s.
TEST(ReferenceSoftness, spring_decays_as_backward_euler) {
  const double h = 1.0 / 240, mu = 2.0 * 2.0 * std::numbers::pi, zeta = 0.1;
  const std::complex<double> s(-zeta * mu, mu * std::sqrt(1.0 - zeta * zeta));
  const std::complex<double> measured = -std::log(1.0 - h * s) / h;
  EXPECT_NEAR(measured.imag() / (2.0 * std::numbers::pi), 1.978, 5e-4);
  EXPECT_NEAR(-measured.real() / std::abs(measured), 0.126, 5e-4);

  // x_n = Re(a z^n) with x_0 = 0.1 and v_0 = Re(a s) = 0.
  const std::complex<double> a(0.1, 0.1 * s.real() / s.imag());
  for (const Method method : every_method) {
    const Mechanism sliders(two_sliders(Frequency{mu, zeta}, 0.1));
    State state = sliders.initial_state();
    for (int n = 1; n <= 480; ++n) {
      state = step(sliders, with(method, h, 1, 1), state, sliders.initial_inputs()).state;
      ASSERT_NEAR(relative(state), (a * std::pow(1.0 - h * s, -n)).real(), 1e-12) << static_cast<int>(method) << n;
    }
  }
}

// The same spring in continuous time, with an offset: C'' + 2 zeta mu C' + mu^2 C = 0.
TEST(ReferenceSoftness, spring_in_exact_motion_is_the_damped_oscillator) {
  const double mu = 15.0, zeta = 0.2, time = 0.4, offset = 0.3;
  const std::complex<double> s(-zeta * mu, mu * std::sqrt(1.0 - zeta * zeta)), a(0.1, 0.1 * s.real() / s.imag());
  Model model = two_sliders(Frequency{mu, zeta}, 0.1 - offset);
  model.couplings[0].offset = offset;
  const Mechanism sliders(model);
  const Motion motion = integrate(sliders, sliders.initial_state(), held, time, 1, 400);
  EXPECT_NEAR(relative(motion.end) + offset, (a * std::exp(s * time)).real(), 1e-9);

  model.couplings[0].softness = ErpCfm{0.2, 0.1};
  const Mechanism by_step(model);
  EXPECT_THROW(integrate(by_step, by_step.initial_state(), held, time, 1, 1), SettingsError);
}

// A hangs on the spring of the coupling, and a drive holds B. For any method and any number of iterations, the spring
// bears the weight of A at rest: kp C = -m g.
TEST(ReferenceSoftness, spring_at_rest_sags_by_the_weight_it_bears) {
  Model model = two_sliders(Spring{300.0, 40.0});
  model.gravity = {0, 0, -9.81};
  model.joints[1].drive = {1000.0, 100.0, 0.0, 0.0};
  const Mechanism sliders(model);
  for (const Method method : every_method)
    for (const int iterations : {1, 4, 16})
      for (const int velocity_iterations : {0, 2}) {
        const StepSettings settings = with(method, 1.0 / 240, iterations, velocity_iterations);
        State state = sliders.initial_state();
        for (int n = 0; n < 2000; ++n) state = step(sliders, settings, state, sliders.initial_inputs()).state;
        EXPECT_NEAR(relative(state), -9.81 / 300.0, 1e-10) << static_cast<int>(method) << iterations;
        EXPECT_NEAR(state.q[1], -2 * 9.81 / 1000.0, 1e-10);
      }
}

TEST(ReferenceSoftness, equal_softness_of_any_kind_gives_the_same_row) {
  const double r = 2.0, h = 0.01;
  const Row from_spring = row(Spring{800.0, 40.0}, r, h);
  EXPECT_NEAR(from_spring.erp, 8.0 / 48.0, 1e-15);  // (23)
  EXPECT_NEAR(from_spring.cfm, 1.0 / 0.48, 1e-15);  // (22)
  const Softness others[] = {Frequency{40.0, 1.0}, ErpCfm{from_spring.erp, from_spring.cfm}};
  for (const Softness& softness : others) {
    const Row same = row(softness, r, h), half = substep_row(softness, r, h, 2);
    EXPECT_NEAR(same.erp, from_spring.erp, 1e-15);
    EXPECT_NEAR(same.cfm, from_spring.cfm, 1e-14);
    EXPECT_NEAR(half.erp, row(Spring{800.0, 40.0}, r, h / 2).erp, 1e-15);
    EXPECT_NEAR(half.cfm, row(Spring{800.0, 40.0}, r, h / 2).cfm, 1e-14);
  }
  EXPECT_NEAR(std::pow(1.0 - substep_row(Hard{0.3}, r, h, 5).erp, 5), 0.7, 1e-15);
}

// By (26) and (27), a frequency refers to the inertia with armature, but without damping and drives.
TEST(ReferenceSoftness, frequency_refers_to_the_mechanism_with_armature) {
  Model model = two_sliders(Frequency{30.0, 0.5});
  model.joints[0].armature = 1.0;
  model.joints[0].damping = 3.0;
  model.joints[1].drive = {500.0, 20.0, 0.0, 0.0};
  const Mechanism sliders(model);
  const double h = 0.01, r = 1.0 / 2.0 + 1.0, kp = 900.0 / r, kd = 2.0 * 30.0 * 0.5 / r;
  const Stage stage(sliders, h, sliders.initial_state(), sliders.initial_inputs());
  EXPECT_NEAR(stage.rows[0].cfm, 1.0 / (h * (h * kp + kd)), 1e-13);
  EXPECT_NEAR(stage.response(0, 0), 1.0 / (2.0 + 0.03) + 1.0 / (1.0 + h * 20.0 + h * h * 500.0), 1e-14);
}

TEST(ReferenceSoftness, zero_stiffness_and_damping_remove_a_coupling) {
  for (const Softness& zero : std::vector<Softness>{Spring{0.0, 0.0}, Frequency{0.0, 1.0}})
    for (const Method method : every_method) {
      const Mechanism sliders(two_sliders(zero, 0.1, 0.5));
      const Step result = once(sliders, with(method, 0.01));
      EXPECT_EQ(result.impulses[0], 0.0);
      EXPECT_NEAR(result.state.v[0], 0.5, 1e-15);
      EXPECT_EQ(result.state.v[1], 0.0);
    }
}

// ---------------------------------------------------------------- hard rows

// The error shrinks by the factor 1 - erp per step for any number of sub-steps, and no correction stays in v.
TEST(ReferenceHardRows, error_shrinks_by_erp_per_step) {
  for (const Method method : every_method)
    for (const int iterations : {1, 4, 7}) {
      const Mechanism sliders(two_sliders(Hard{0.3}, 0.1));
      State state = sliders.initial_state();
      double expected = 0.1;
      for (int n = 0; n < 20; ++n) {
        state = step(sliders, with(method, 0.01, iterations), state, sliders.initial_inputs()).state;
        expected *= 0.7;
        EXPECT_NEAR(relative(state), expected, 1e-15) << static_cast<int>(method) << iterations;
        EXPECT_NEAR(state.v[0] - state.v[1], 0.0, 1e-14);
      }
    }
}

TEST(ReferenceHardRows, erp_above_1_cannot_be_shared_by_substeps) {
  const Mechanism sliders(two_sliders(Hard{1.5}, 0.1));
  EXPECT_THROW(once(sliders, with(Method::tgs, 0.01, 2)), SettingsError);
  EXPECT_NEAR(relative(once(sliders, with(Method::tgs, 0.01, 1)).state), -0.05, 1e-15);
  EXPECT_NEAR(relative(once(sliders, with(Method::pgs, 0.01, 4)).state), -0.05, 1e-15);
}

TEST(ReferenceHardRows, dependent_rows_take_no_impulse_and_change_nothing) {
  const Mechanism loop(scenes::redundant());
  EXPECT_EQ(Couplings(loop).redundant, (std::vector<bool>{false, false, true}));
  Model chain = scenes::redundant();
  chain.couplings.pop_back();
  const Mechanism open(chain);
  for (const Method method : every_method) {
    const Step with_loop = once(loop, with(method)), without = once(open, with(method));
    EXPECT_EQ(with_loop.impulses[2], 0.0);
    EXPECT_LT(difference(with_loop.state.v, without.state.v), 1e-15);
  }
}

// The order of the rows decides which ones are redundant, their rank how many. Soft rows are never redundant.
TEST(ReferenceHardRows, redundancy_follows_from_the_rank) {
  int found = 0;
  for (int seed = 0; seed < 200; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed));
    const Couplings couplings(mechanism);
    std::vector<int> hard, independent;
    for (int i = 0; i < couplings.count(); ++i) {
      if (is_hard(couplings.softness[i])) hard.push_back(i);
      if (is_hard(couplings.softness[i]) && !couplings.redundant[i]) independent.push_back(i);
      if (!is_hard(couplings.softness[i])) {
        EXPECT_FALSE(couplings.redundant[i]);
      }
    }
    if (hard.empty()) continue;
    const MatrixXd rows = couplings.jacobian(hard, Eigen::all);
    EXPECT_EQ(static_cast<Eigen::Index>(independent.size()), rows.colPivHouseholderQr().rank()) << seed;
    found += independent.size() < hard.size();
  }
  EXPECT_GT(found, 3);
}

// ---------------------------------------------------------------- methods

// One body on an implicit drive: m (v' - v) / h = tau - d v' - kp (q + h v' - q_t) - kd (v' - v_t).
TEST(ReferenceMethods, free_velocity_takes_damping_and_drive_at_the_end_of_the_step) {
  Model model = two_sliders(Spring{0.0, 0.0}, 0.2, 0.7);
  model.joints[0].damping = 3.0, model.joints[0].armature = 0.5, model.joints[0].effort = 5.0;
  model.joints[0].drive = {400.0, 30.0, 0.5, -0.2};
  const Mechanism sliders(model);
  const double h = 0.02, m = 1.5;
  const double expected = (m * 0.7 + h * (5.0 - 400.0 * (0.2 - 0.5) + 30.0 * -0.2)) / (m + h * 33.0 + h * h * 400.0);
  const Stage stage(sliders, h, sliders.initial_state(), sliders.initial_inputs());
  EXPECT_NEAR(stage.free[0], expected, 1e-14);
}

// If A does not change and there is one row only, N sub-steps of h / N are N steps of h / N.
TEST(ReferenceMethods, tgs_gives_the_motion_of_as_many_small_steps) {
  const double h = 0.02;
  const int n = 5;
  const Softness erp_cfm = ErpCfm{0.3, 0.8};
  const SpringConstants same = spring(erp_cfm, 2.0, h);
  const std::pair<Softness, Softness> pairs[] = {{Spring{300.0, 4.0}, Spring{300.0, 4.0}},
                                                 {Frequency{20.0, 0.2}, Frequency{20.0, 0.2}},
                                                 {erp_cfm, Spring{same.kp, same.kd}}};
  for (const auto& [whole, small] : pairs) {
    Model model = two_sliders(whole, 0.1, 0.5);
    model.gravity = {1, 2, -9.81};
    const Mechanism sliders(model);
    model.couplings[0].softness = small;
    const Mechanism in_small_steps(model);
    State state = sliders.initial_state();
    double impulse = 0.0;
    for (int i = 0; i < n; ++i) {
      const Step part = step(in_small_steps, with(Method::direct, h / n, 1, 0), state, sliders.initial_inputs());
      state = part.state;
      impulse += part.impulses[0];
    }
    const Step whole_step = once(sliders, with(Method::tgs, h, n, 1));
    EXPECT_LT(difference(whole_step.state.q, state.q), 1e-15);
    EXPECT_LT(difference(whole_step.state.v, state.v), 1e-14);
    EXPECT_NEAR(whole_step.impulses[0], impulse, 1e-14);
  }
}

TEST(ReferenceMethods, couplings_may_lock_all_joints) {
  Model model = two_sliders(Hard{}, 0.0, 0.5);
  model.gravity = {0, 0, -9.81};
  model.couplings.push_back(Coupling::mimic("A", "B", 1.0));
  const Mechanism sliders(model);
  for (const Method method : every_method) EXPECT_LT(once(sliders, with(method)).state.v.norm(), 1e-15);
  EXPECT_LT(acceleration(sliders, sliders.initial_state(), sliders.initial_inputs()).norm(), 1e-15);
}

// The solution is defined by A (v - v*) = J^T L, and J v + b + cfm L = 0 in every row.
TEST(ReferenceMethods, direct_satisfies_every_row) {
  for (int seed = 0; seed < 50; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed));
    const Stage stage(mechanism, 1.0 / 240, mechanism.initial_state(), mechanism.initial_inputs());
    const Solution solution = direct(stage, with(Method::direct, 1.0 / 240, 4, 0));
    const VectorXd momentum = stage.implicit * (solution.velocity - stage.free);
    const VectorXd given = stage.jacobian.transpose() * solution.impulses;
    EXPECT_LT(difference(momentum, given), 1e-9 * (1.0 + momentum.norm())) << seed;
    for (int i = 0; i < solution.impulses.size(); ++i) {
      if (!stage.rows[i].active) continue;
      const double residual = stage.jacobian.row(i).dot(solution.velocity) + stage.correction[i];
      EXPECT_NEAR(residual + stage.rows[i].cfm * solution.impulses[i], 0.0, 1e-9) << seed;
    }
  }
}

TEST(ReferenceMethods, reduced_agrees_with_direct) {
  for (int seed = 0; seed < 100; ++seed) {
    const Mechanism mechanism(scenes::random_model(seed));
    for (const int velocity_iterations : {0, 1}) {
      const Step a = once(mechanism, with(Method::direct, 1.0 / 240, 4, velocity_iterations));
      const Step b = once(mechanism, with(Method::reduced, 1.0 / 240, 4, velocity_iterations));
      EXPECT_LT(difference(a.state.q, b.state.q), 1e-11) << seed;
      EXPECT_LT(difference(a.state.v, b.state.v), 1e-11 * (1.0 + a.state.v.norm())) << seed;
      EXPECT_LT(difference(a.impulses, b.impulses), 1e-11 * (1.0 + a.impulses.norm())) << seed;
    }
  }
}

TEST(ReferenceMethods, pgs_converges_to_direct) {
  for (const char* name : {"chain8", "gripper13", "redundant", "gear100"}) {
    Model model = scenes::scene(name).model;
    for (Joint& joint : model.joints) joint.position += 0.01 * joint.axis[1];  // an error to correct
    const Mechanism mechanism(model);
    const Stage stage(mechanism, 1.0 / 240, mechanism.initial_state(), mechanism.initial_inputs());
    const Solution exact = direct(stage, with(Method::direct));
    const auto distance = [&](int sweeps) {
      return difference(pgs(stage, with(Method::pgs, 1.0 / 240, sweeps, sweeps)).velocity, exact.velocity);
    };
    EXPECT_LT(distance(1000), 1e-10) << name;
    EXPECT_GT(distance(1), 1e-5) << name << " needs only one sweep";
  }
}

TEST(ReferenceMethods, automatic_is_refused) {
  const Mechanism sliders(two_sliders(Hard{}));
  EXPECT_THROW(once(sliders, with(Method::automatic)), SettingsError);
}

}  // namespace
}  // namespace lockstep::reference
