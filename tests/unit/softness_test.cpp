// A soft coupling is the same spring for any kind and any number of visits. SPDX-License-Identifier: Apache-2.0
//
// Two sliders A and B with C = q_A - q_B are one oscillator: r = 1/m_A + 1/m_B (15) and C'' = -r (kp C + kd C').
// Implicit integration of first order (21) with steps h turns it into
//     u' = u - h r (kp C' + kd u'),  C' = C + h u'.
// Its poles are z = 1 / (1 - h s) for the poles s of the continuous oscillator.
#include <cmath>
#include <complex>
#include <numbers>

#include "lockstep/plan.h"
#include "physics.h"
#include "reference/step.h"

namespace lockstep {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr double h = 1.0 / 240, mass_a = 0.7, mass_b = 0.3, r = 1.0 / mass_a + 1.0 / mass_b;

// The matrix that takes (C, C') one implicit step further, for C'' = -stiffness C - rate C'.
Matrix2d backward_euler(double step, double stiffness, double rate) {
  Matrix2d f;
  f << 0.0, 1.0, -stiffness, -rate;
  return (Matrix2d::Identity() - step * f).inverse();
}

Model oscillator(const Softness& softness) {
  Model model = physics::sliders({mass_a, mass_b});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.0, softness)};
  model.joints[0].position = 0.1;
  model.joints[0].velocity = 0.5;
  model.joints[1].velocity = -0.2;
  return model;
}

Vector2d error_and_rate(const Batch<double>& batch) {
  return {batch.positions()(0, 0) - batch.positions()(1, 0), batch.velocities()(0, 0) - batch.velocities()(1, 0)};
}

// Expects that (C, C') follows the powers of a 2 x 2 matrix.
void expect_motion(const Model& model, const StepSettings& settings, const Matrix2d& per_step) {
  SCOPED_TRACE(std::string(to_string(settings.method)) + " " + std::to_string(settings.iterations) + " + " +
               std::to_string(settings.velocity_iterations));
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  Vector2d exact = error_and_rate(batch);
  for (int step = 0; step < 240; ++step) {
    batch.step();
    exact = per_step * exact;
    ASSERT_NEAR(error_and_rate(batch)[0], exact[0], 1e-12) << step;
    ASSERT_NEAR(error_and_rate(batch)[1], exact[1], 1e-11) << step;
  }
}

struct Visits {
  Method method;
  int iterations, velocity_iterations;
};
std::vector<Visits> visits() {
  std::vector<Visits> all;
  for (int velocity_iterations : {0, 1, 3}) {
    for (int sweeps : {1, 4, 16, 64}) all.push_back({Method::pgs, sweeps, velocity_iterations});
    all.push_back({Method::direct, 4, velocity_iterations});
    all.push_back({Method::reduced, 4, velocity_iterations});
  }
  return all;
}

const Softness soft = Frequency{4.0 * std::numbers::pi, 0.1};  // 2 Hz
const double stiffness = std::pow(4.0 * std::numbers::pi, 2), rate = 2.0 * 0.1 * 4.0 * std::numbers::pi;

TEST(SoftCoupling, is_an_implicit_spring_for_any_number_of_visits) {
  for (const Visits& v : visits())
    expect_motion(oscillator(soft), physics::settings(v.method, v.iterations, v.velocity_iterations),
                  backward_euler(h, stiffness, rate));
}

TEST(SoftCoupling, is_an_implicit_spring_in_each_sub_step_of_tgs) {
  for (int n : {1, 2, 4, 16})
    for (int velocity_iterations : {0, 1, 3}) {
      Matrix2d step = Matrix2d::Identity();
      for (int i = 0; i < n; ++i) step = backward_euler(h / n, stiffness, rate) * step;
      expect_motion(oscillator(soft), physics::settings(Method::tgs, n, velocity_iterations), step);
    }
}

// Damping d = beta m and drives kp = kappa m accelerate both bodies alike, so they add beta and kappa to the rates of
// the oscillator. They are part of A, which must not change the meaning of mu and zeta.
TEST(SoftCoupling, keeps_its_frequency_beside_damping_and_drives) {
  constexpr double beta = 3.0, kappa = 200.0, drag = 1.5;
  Model model = oscillator(soft);
  for (int i = 0; i < 2; ++i) {
    const double mass = model.links[i + 1].inertia.mass;
    model.joints[i].damping = beta * mass;
    model.joints[i].drive = {kappa * mass, drag * mass, 0.0, 0.0};
  }
  for (const Visits& v : visits())
    expect_motion(model, physics::settings(v.method, v.iterations, v.velocity_iterations),
                  backward_euler(h, stiffness + kappa, rate + beta + drag));
}

TEST(SoftCoupling, refers_its_frequency_to_inertia_with_armature) {
  Model model = oscillator(soft);
  model.joints[0].armature = 1.1;
  for (const Visits& v : visits())
    expect_motion(model, physics::settings(v.method, v.iterations, v.velocity_iterations),
                  backward_euler(h, stiffness, rate));
}

// A hard coupling to a third body adds G^2 m to the mass of A in the oscillator. mu and zeta still refer to r.
TEST(SoftCoupling, keeps_its_spring_beside_a_hard_coupling) {
  constexpr double gear = 2.0, mass_c = 0.4;
  Model model = physics::sliders({mass_a, mass_b, mass_c});
  model.couplings = {Coupling::mimic("s2", "s0", -gear), Coupling::mimic("s0", "s1", -1.0, 0.0, soft)};
  model.joints[0].position = 0.1, model.joints[2].position = gear * 0.1;
  model.joints[0].velocity = 0.5, model.joints[2].velocity = gear * 0.5;
  const double share = (1.0 / (mass_a + gear * gear * mass_c) + 1.0 / mass_b) / r;
  for (Method method : {Method::direct, Method::reduced})
    for (int velocity_iterations : {0, 1, 3})
      expect_motion(model, physics::settings(method, 4, velocity_iterations),
                    backward_euler(h, share * stiffness, share * rate));
}

// By z = 1 / (1 - h s), a frequency of 2 Hz becomes 1.978 Hz, and a damping ratio of 0.1 becomes 0.126.
TEST(SoftCoupling, has_the_frequency_and_damping_of_backward_euler) {
  Batch<double> batch(compile(oscillator(soft), physics::settings(Method::pgs)), 1, {.threads = 1});
  double c[4];
  for (double& error : c) {
    batch.step(20);
    error = error_and_rate(batch)[0];
  }
  // Every motion of the oscillator satisfies C_k+2 = a C_k+1 + b C_k, and its poles are the roots of z^2 = a z + b.
  Matrix2d samples;
  samples << c[1], c[0], c[2], c[1];
  const Vector2d recurrence = samples.partialPivLu().solve(Vector2d(c[2], c[3]));
  const std::complex<double> z =
      0.5 * (recurrence[0] + std::sqrt(std::complex<double>(recurrence[0] * recurrence[0] + 4.0 * recurrence[1])));
  const std::complex<double> measured = std::log(z) / (20.0 * h);
  const double measured_frequency = measured.imag() / (2.0 * std::numbers::pi),
               zeta = -measured.real() / std::abs(measured);

  const std::complex<double> s = 4.0 * std::numbers::pi * std::complex<double>(-0.1, std::sqrt(1.0 - 0.01));
  const std::complex<double> expected = -std::log(1.0 - h * s) / h;
  EXPECT_NEAR(measured_frequency, expected.imag() / (2.0 * std::numbers::pi), 1e-6);
  EXPECT_NEAR(zeta, -expected.real() / std::abs(expected), 1e-6);
  EXPECT_NEAR(measured_frequency, 1.978, 5e-4);
  EXPECT_NEAR(zeta, 0.126, 5e-4);
}

// Arm A points sideways. Arm B turns about the vertical, and a drive holds it. At rest kp C = m g l cos q_A with
// kp = mu^2 / r (26), and the drive bears the same torque.
TEST(SoftCoupling, sags_under_a_load_by_its_stiffness) {
  constexpr double mu = 10.0 * std::numbers::pi, drive = 50.0, g = 9.81, l = 0.05, mass = 0.2;
  const double inertia = mass * ((0.1 * 0.1 + 0.04 * 0.04) / 12.0 + l * l), kp = mu * mu * inertia / 2.0;
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, Eigen::Vector3d::UnitY());
  Joint& driven = physics::append_link(model, "base", {0, 0, 1}, Eigen::Vector3d::UnitZ());
  driven.drive = {drive, 1.0, 0.0, 0.0};
  driven.damping = 0.01;
  model.couplings = {Coupling::mimic("j0", "j1", -1.0, 0.0, Frequency{mu, 1.0})};

  double sag = 0.0;  // C, by Newton's method; q_A = C + kp C / drive, and gravity turns arm A about +y
  const double arm = 1.0 + kp / drive;
  for (int i = 0; i < 20; ++i)
    sag -= (kp * sag - mass * g * l * std::cos(arm * sag)) / (kp + mass * g * l * arm * std::sin(arm * sag));
  ASSERT_GT(sag, 0.2);

  std::vector<Visits> all = visits();
  for (int n : {1, 4, 16})
    for (int velocity_iterations : {0, 1, 3}) all.push_back({Method::tgs, n, velocity_iterations});
  for (const Visits& v : all) {
    const Plan plan = compile(model, physics::settings(v.method, v.iterations, v.velocity_iterations));
    Batch<double> batch(plan, 1, {.threads = 1});
    batch.step(2400);
    EXPECT_NEAR(batch.coupling_errors()(0, 0), sag, 1e-10) << to_string(v.method) << ' ' << v.iterations;
    EXPECT_NEAR(batch.velocities()(0, 0), 0.0, 1e-9) << to_string(v.method) << ' ' << v.iterations;
  }
}

// The first visit is (18), and any number of visits gives (21). The literal (18) does not remember what it has applied,
// so with more visits it approaches the hard row: -(J v + b) / r (1 - p^n) with p = cfm / (r + cfm).
TEST(SoftCoupling, applies_the_impulse_of_21_for_any_number_of_visits) {
  constexpr double dt = 0.01, two = 2.0, c = 0.1, v = 0.5, mu = 40.0, zeta = 1.0;
  Model model = physics::sliders({1.0, 1.0});
  model.couplings = {Coupling::mimic("s0", "s1", -1.0, 0.0, Frequency{mu, zeta})};
  model.joints[0].position = c;
  model.joints[0].velocity = v;
  const double kp = mu * mu / two, kd = 2.0 * mu * zeta / two;                     // (26), (27)
  const double cfm = 1.0 / (dt * (dt * kp + kd)), erp = dt * kp / (dt * kp + kd);  // (28), (29)
  const double by_18 = -(c * erp / dt + v) / (two + cfm);
  const double by_21 = -(c * kp * dt + v * dt * (dt * kp + kd)) / (1.0 + two * dt * (dt * kp + kd));
  ASSERT_NEAR(by_18, by_21, 1e-15);

  const reference::Mechanism mechanism(model);
  const reference::Stage stage(mechanism, dt, mechanism.initial_state(), mechanism.initial_inputs());
  for (int sweeps : {1, 2, 4, 8, 64}) {
    StepSettings settings = physics::settings(Method::pgs, sweeps, 1, dt);
    settings.record_impulses = true;
    Batch<double> batch(compile(model, settings), 1, {.threads = 1});
    batch.step();
    EXPECT_NEAR(batch.coupling_impulses()(0, 0), by_21, 1e-14);
    const double without_memory = -(v + erp * c / dt) / two * (1.0 - std::pow(cfm / (two + cfm), sweeps));
    EXPECT_NEAR(reference::literal_18(stage, settings).impulses[0], without_memory, 1e-14);
  }
}

TEST(Softness, gives_the_same_motion_in_each_of_its_kinds) {
  const double mu = 25.0, zeta = 0.4, kp = mu * mu / r, kd = 2.0 * mu * zeta / r;
  const Softness frequency = Frequency{mu, zeta}, spring = Spring{kp, kd},
                 erp_cfm = ErpCfm{h * kp / (h * kp + kd), 1.0 / (h * (h * kp + kd))};  // (23), (22)
  const auto end = [](const Softness& softness, Method method) {
    Batch<double> batch(compile(oscillator(softness), physics::settings(method)), 1, {.threads = 1});
    batch.step(100);
    return error_and_rate(batch);
  };
  for (Method method : physics::methods) {
    EXPECT_LE((end(spring, method) - end(frequency, method)).norm(), 1e-12) << to_string(method);
    EXPECT_LE((end(erp_cfm, method) - end(frequency, method)).norm(), 1e-12) << to_string(method);
    EXPECT_EQ(end(ErpCfm{0.3, 0.0}, method), end(Hard{0.3}, method)) << to_string(method);
  }
}

TEST(Softness, removes_a_coupling_with_zero_stiffness_and_zero_damping) {
  Model model = oscillator(Spring{0.0, 0.0}), other = oscillator(Frequency{0.0, 1.0}), free = model;
  free.couplings.clear();
  for (Method method : physics::methods)
    for (Model* with_coupling : {&model, &other}) {
      Batch<double> with(compile(*with_coupling, physics::settings(method)), 1, {.threads = 1});
      Batch<double> without(compile(free, physics::settings(method)), 1, {.threads = 1});
      with.step(50), without.step(50);
      EXPECT_EQ(error_and_rate(with), error_and_rate(without)) << to_string(method);
    }
}

}  // namespace
}  // namespace lockstep
