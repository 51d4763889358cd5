// A step keeps the invariants of mechanics, exactly or to first order in dt. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <functional>
#include <numbers>

#include "lockstep/plan.h"
#include "physics.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using physics::settings;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Calls measure(batch) at the start and after each step of `duration` seconds.
void watch(const Model& model, double dt, double duration, const std::function<void(const Batch<double>&)>& measure,
           Method method = Method::reduced) {
  Batch<double> batch(compile(model, settings(method, 4, 1, dt)), 1, {.threads = 1});
  measure(batch);
  for (int step = 0; step < std::lround(duration / dt); ++step) {
    batch.step();
    measure(batch);
  }
}

// The error is of first order: half the step has about half the error, as e(h) = a h + b h^2.
void expect_first_order(const std::function<double(double dt)>& error, double dt) {
  const double whole = error(dt), half = error(dt / 2), quarter = error(dt / 4);
  EXPECT_NEAR(whole / half, 2.0, 0.4);
  EXPECT_NEAR(half / quarter, 2.0, 0.2);
}

// --- energy ------------------------------------------------------------------------------------------

double energy(const Batch<double>& batch) { return batch.kinetic_energies()(0, 0) + batch.potential_energies()(0, 0); }

TEST(Energy, drifts_with_the_step_only_in_a_passive_arm_without_damping) {
  for (Method method : {Method::direct, Method::reduced}) {
    Model model = scenes::chain8();
    for (Joint& joint : model.joints) joint.damping = 0.0;
    const auto drift = [&](double dt) {
      double start = NAN, worst = 0.0;
      watch(
          model, dt, 0.5,
          [&](const Batch<double>& batch) {
            if (std::isnan(start)) start = energy(batch);
            worst = std::max(worst, std::abs(energy(batch) - start));
          },
          method);
      return worst;
    };
    expect_first_order(drift, 1.0 / 960);
  }
}

// Damping removes more energy than the first-order error of the step can add.
TEST(Energy, never_grows_in_a_damped_arm) {
  double last = infinity, highest = -infinity, lowest = infinity;
  watch(scenes::chain8(), 1.0 / 240, 5.0, [&](const Batch<double>& batch) {
    const double now = energy(batch);
    EXPECT_LE(now, last);
    highest = std::max(highest, now), lowest = std::min(lowest, now), last = now;
  });
  EXPECT_GT(highest - lowest, 0.1);
}

// The root of this whip tumbles. The first-order error comes from the joints; the turning of the root must not add to
// it (M48). If the velocity of the root were stepped along the turning axes, the energy would grow by a factor of 1.8.
TEST(Energy, grows_in_a_whip_by_the_error_of_its_joints_only) {
  double start = NAN, highest = -infinity;
  watch(scenes::chain32(), 1.0 / 240, 1.0, [&](const Batch<double>& batch) {
    if (std::isnan(start)) start = energy(batch);
    highest = std::max(highest, energy(batch));
  });
  EXPECT_LE(highest, 1.35 * start);
}

// --- momentum ----------------------------------------------------------------------------------------

scenes::RandomOptions floating() {
  scenes::RandomOptions options;
  options.root = scenes::RandomOptions::Root::floating;
  options.coupling_error = false;
  return options;
}

Vector6d momentum_after(const Model& model, double dt, int steps) {
  Batch<double> batch(compile(model, settings(Method::direct, 4, 1, dt)), 1, {.threads = 1});
  batch.step(steps);
  return batch.momenta().col(0).matrix();
}

// Damping, drives, efforts and couplings are all internal. (P(h) - P) / h is the rate of change plus a h + b h^2, as
// long as no velocity jumps. Springs given by erp and cfm get stiffer with smaller steps, so they are replaced by
// springs given by kp and kd. Twice the value at h / 2 minus the value at h removes a h. At 1e-7 s, b h^2 is 1e-6 even
// for drives with a rate of 1e4 /s, and the rounding of P divided by h is 1e-8 of P.
TEST(Momentum, has_zero_rate_of_change_in_a_floating_mechanism) {
  for (int seed = 0; seed < 50; ++seed) {
    Model model = scenes::random_model(static_cast<std::uint64_t>(seed), floating());
    model.gravity.setZero();
    for (Coupling& coupling : model.couplings)
      if (std::holds_alternative<ErpCfm>(coupling.softness) && !is_hard(coupling.softness))
        coupling.softness = Spring{50.0, 1.0};
    constexpr double h = 1e-7;
    const Vector6d start = momentum_after(model, h, 0);
    const auto rate = [&](double dt) -> Vector6d { return (momentum_after(model, dt, 1) - start) / dt; };
    const Vector6d extrapolated = 2.0 * rate(h / 2) - rate(h);
    EXPECT_LE(extrapolated.norm(), 1e-6 * std::max(1.0, start.norm())) << seed;
  }
}

TEST(Momentum, drifts_with_the_step_only_in_a_floating_chain) {
  Model model = scenes::chain32();
  model.roots[0].velocity << 0.3, -0.2, 0.5, 1.0, 0.0, -1.0;
  for (int part : {0, 3})  // angular, linear
    expect_first_order(
        [&](double dt) {
          const int steps = static_cast<int>(std::lround(0.25 / dt));
          return (momentum_after(model, dt, steps) - momentum_after(model, dt, 0)).segment<3>(part).norm();
        },
        1.0 / 1920);
}

// --- symmetries --------------------------------------------------------------------------------------

// A floating palm with two fingers that mirror each other in y, so that their joint angles have opposite signs.
TEST(Symmetry, is_kept_by_a_mirrored_gripper) {
  Model model;
  model.links = {{"palm", Inertia::box(0.5, {0.1, 0.1, 0.05}, Vector3d(0.01, 0, 0.02))}};
  model.roots = {{model.links[0].name, true}};
  for (double side : {1.0, -1.0})
    for (int i = 0; i < 3; ++i) {
      const std::string parent = i == 0 ? "palm" : model.links.back().name;
      const std::string before = i == 0 ? "" : model.joints.back().name;
      Joint& joint = physics::append_link(model, parent, {0.0, side * (i == 0 ? 0.05 : 0.02), 0.04}, Vector3d::UnitX());
      model.links.back().inertia = Inertia::box(0.05, {0.02, 0.02, 0.04}, {0.0, side * 0.003, 0.02});
      joint.position = side * (0.3 - 0.1 * i);
      joint.damping = 1e-3;
      if (i == 0) joint.drive = {2.0, 0.05, side * -0.5, 0.0};
      if (i > 0) model.couplings.push_back(Coupling::mimic(joint.name, before, -0.7));
    }
  for (Method method : {Method::direct, Method::reduced})
    watch(
        model, 1.0 / 240, 1.0,
        [&](const Batch<double>& batch) {
          const auto q = batch.positions().col(0);
          EXPECT_LE((q.head(3) + q.tail(3)).abs().maxCoeff(), 1e-12);
          EXPECT_NEAR(batch.root_poses()(1, 0), 0.0, 1e-12);                             // y
          for (int axis : {4, 6}) EXPECT_NEAR(batch.root_poses()(axis, 0), 0.0, 1e-12);  // no turns about x and z
        },
        method);
}

// The mechanism and gravity are displaced and turned together, which does not change the motion of the joints.
TEST(Symmetry, keeps_the_motion_of_joints_at_another_place) {
  const Eigen::Isometry3d moved =
      Eigen::Translation3d(3.0, -2.0, 7.0) * Eigen::AngleAxisd(2.0, Vector3d(1.0, -2.0, 0.5).normalized());
  for (int seed = 0; seed < 30; ++seed) {
    const Model here = scenes::random_model(static_cast<std::uint64_t>(seed));
    Model there = here;
    there.roots[0].pose = moved * here.roots[0].pose;
    there.gravity = moved.linear() * here.gravity;
    Batch<double> a(compile(here, settings(Method::direct)), 1, {.threads = 1});
    Batch<double> b(compile(there, settings(Method::direct)), 1, {.threads = 1});
    a.step(24), b.step(24);
    const double speed = std::max(1.0, a.velocities().abs().maxCoeff());
    EXPECT_LE((a.positions() - b.positions()).abs().maxCoeff(), 1e-10) << seed;
    EXPECT_LE((a.velocities() - b.velocities()).abs().maxCoeff(), 1e-10 * speed) << seed;
  }
}

// A uniform motion is added to the root. The velocity of the root is stepped in inertial axes, so not even the error of
// the step depends on it.
TEST(Symmetry, keeps_all_other_motion_under_a_uniform_motion) {
  const Vector3d velocity(2.0, -1.0, 0.5);
  for (int seed = 0; seed < 30; ++seed) {
    const Model still = scenes::random_model(static_cast<std::uint64_t>(seed), floating());
    Model moving = still;
    moving.roots[0].velocity.tail<3>() += still.roots[0].pose.linear().transpose() * velocity;
    Batch<double> a(compile(still, settings(Method::direct)), 1, {.threads = 1});
    Batch<double> b(compile(moving, settings(Method::direct)), 1, {.threads = 1});
    a.step(24), b.step(24);
    EXPECT_LE((a.positions() - b.positions()).abs().maxCoeff(), 1e-10) << seed;
    EXPECT_LE((a.root_poses() - b.root_poses()).bottomRows(4).abs().maxCoeff(), 1e-10) << seed;
    const Vector3d distance = (b.root_poses() - a.root_poses()).col(0).head(3).matrix();
    EXPECT_LE((distance - 24.0 / 240.0 * velocity).norm(), 1e-10) << seed;
    const Vector3d faster = (b.root_velocities() - a.root_velocities()).col(0).tail(3).matrix();
    EXPECT_LE((physics::state_of(a).roots[0].orientation * faster - velocity).norm(), 1e-10) << seed;
  }
}

// --- textbook bodies ---------------------------------------------------------------------------------

Model free_body(const Vector3d& spin) {
  Model model;
  model.links = {{"body", Inertia::box(1.0, {0.3, 0.2, 0.1}, Vector3d::Zero())}};
  model.roots = {{model.links[0].name, true}};
  model.roots[0].velocity.head<3>() = spin;
  model.gravity.setZero();
  return model;
}

// Solves I dw/dt + w x I w = 0 by Runge-Kutta 4 with steps far below those of the tests.
Vector3d euler_spin(const Matrix3d& inertia, Vector3d w, double duration) {
  const auto slope = [&](const Vector3d& at) -> Vector3d { return -inertia.inverse() * at.cross(inertia * at); };
  constexpr int steps = 4000;
  const double h = duration / steps;
  for (int i = 0; i < steps; ++i) {
    const Vector3d k1 = slope(w), k2 = slope(w + h / 2 * k1), k3 = slope(w + h / 2 * k2), k4 = slope(w + h * k3);
    w += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }
  return w;
}

TEST(FreeBody, turns_by_eulers_equations) {
  const Model model = free_body({0.3, 4.0, -0.5});  // near the axis of the middle moment, so it tumbles
  const Vector3d exact = euler_spin(model.links[0].inertia.about_center, model.roots[0].velocity.head<3>(), 1.0);
  ASSERT_GT((exact - model.roots[0].velocity.head<3>()).norm(), 0.5);
  expect_first_order(
      [&](double dt) {
        Vector3d spin;
        watch(model, dt, 1.0, [&](const Batch<double>& b) { spin = b.root_velocities().col(0).head(3).matrix(); });
        return (spin - exact).norm();
      },
      1.0 / 960);
}

TEST(FreeBody, turns_about_a_principal_axis_for_ever) {
  for (int axis = 0; axis < 3; ++axis) {
    const double rate = 2.0 * std::numbers::pi;  // one turn per second
    const Model model = free_body(rate * Vector3d::Unit(axis));
    Batch<double> batch(compile(model, settings(Method::direct)), 1, {.threads = 1});
    batch.step(2400);
    EXPECT_LE((batch.root_velocities().col(0).matrix() - model.roots[0].velocity).norm(), 1e-12);
    // Ten turns lead back to the start; after an even number of turns the quaternion is that of the start, too.
    EXPECT_NEAR(batch.root_poses()(3, 0), 1.0, 1e-12);
    EXPECT_NEAR(batch.root_poses()(4 + axis, 0), 0.0, 1e-11);
  }
}

TEST(FreeBody, falls_as_the_sum_of_its_steps_however_it_tumbles) {
  Model model = free_body({0.3, 4.0, -0.5});
  model.gravity = {0.5, 0.0, -9.81};
  Batch<double> batch(compile(model, settings(Method::direct)), 1, {.threads = 1});
  constexpr int n = 240;
  batch.step(n);  // semi-implicit Euler falls by g h^2 (1 + 2 + ... + n)
  const Vector3d fallen = model.gravity / (240.0 * 240.0) * (n * (n + 1) / 2.0);
  EXPECT_LE((batch.root_poses().col(0).head(3).matrix() - fallen).norm(), 1e-12);
}

TEST(Armature, acts_like_inertia_about_the_axis_of_the_first_joint) {
  Model rotor = scenes::chain8(), heavier = rotor;
  rotor.joints[0].armature = 4e-5;
  heavier.links[1].inertia.about_center(1, 1) += 4e-5;  // j0 turns about y
  for (Method method : {Method::direct, Method::reduced}) {
    Batch<double> a(compile(rotor, settings(method)), 1, {.threads = 1});
    Batch<double> b(compile(heavier, settings(method)), 1, {.threads = 1});
    a.step(240), b.step(240);
    EXPECT_LE((a.positions() - b.positions()).abs().maxCoeff(), 1e-10);
    EXPECT_NEAR(a.kinetic_energies()(0, 0), b.kinetic_energies()(0, 0), 1e-10);
  }
}

// The period is T = 4 sqrt(L / g) K(sin(a / 2)) for the amplitude a, with L = I / (m l). Semi-implicit Euler gives a
// harmonic oscillator the frequency w (1 + (w h)^2 / 24 + ...); for a pendulum the error is smaller.
TEST(Pendulum, swings_with_the_period_of_its_amplitude) {
  constexpr double g = 9.81, l = 0.05, h = 1.0 / 1920;
  const double length = ((0.1 * 0.1 + 0.04 * 0.04) / 12.0 + l * l) / l, w = std::sqrt(g / length);
  for (double amplitude : {0.1, 1.0, 2.5}) {
    Model model;  // two pendulums that are coupled
    model.links = {{"base", {}}};
    for (int i = 0; i < 2; ++i) {
      Joint& joint = physics::append_link(model, "base", {0, 0.2 * i, 0}, Vector3d::UnitY());
      joint.origin.rotate(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3d::UnitY()));  // hangs down at q = 0
      joint.position = amplitude;
    }
    model.couplings = {Coupling::mimic("j1", "j0", -1.0)};
    std::vector<double> crossings;
    double t = -h, before = amplitude;
    watch(model, h, 5.0, [&](const Batch<double>& batch) {
      const double q = batch.positions()(0, 0);
      if (before > 0.0 && q <= 0.0) crossings.push_back(t + h * before / (before - q));
      before = q, t += h;
    });
    ASSERT_GE(crossings.size(), 4u);
    const double period = (crossings.back() - crossings.front()) / static_cast<double>(crossings.size() - 1);
    const double exact = 4.0 / w * std::comp_ellint_1(std::sin(amplitude / 2));
    EXPECT_NEAR(period, exact, 2.0 * (w * h) * (w * h) / 24.0 * exact) << amplitude;
  }
}

}  // namespace
}  // namespace lockstep
