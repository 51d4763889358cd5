// Soft couplings sag and swing according to their stiffness. SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

constexpr double mu = 10.0 * M_PI, g = 9.81, arm = 0.05, mass = 0.2;
const double inertia = mass * ((0.1 * 0.1 + 0.04 * 0.04) / 12.0 + arm * arm);  // of a link about its joint
const double kp = mu * mu * inertia / 2.0;  // (26): two equal links give r = 2 / inertia

double kd(double zeta) { return 2.0 * mu * zeta * inertia / 2.0; }  // (27)

// A soft coupling holds the link of j0 sideways. j1 turns about the vertical, and its drive holds it.
Model hanging(double zeta, bool kinematic) {
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, Eigen::Vector3d::UnitY());
  Joint& driven = physics::append_link(model, "base", {0, 0, 1}, Eigen::Vector3d::UnitZ());
  if (kinematic)
    driven.drive.kinematic = true;
  else
    driven.drive = {1e7, 1e5, 0.0, 0.0};
  model.couplings = {Coupling::mimic("j0", "j1", -1.0, 0.0, Frequency{mu, zeta})};
  return model;
}

// kp q = m g l cos q: 0.276 rad.
double sag() {
  double q = 0.0;
  for (int i = 0; i < 20; ++i) q -= (kp * q - mass * g * arm * std::cos(q)) / (kp + mass * g * arm * std::sin(q));
  return q;
}

constexpr Method all_methods[] = {Method::pgs, Method::tgs, Method::direct, Method::automatic};

TEST(SoftCoupling, sags_by_its_stiffness_under_gravity) {
  ASSERT_NEAR(sag(), 0.276, 5e-4);
  for (bool kinematic : {false, true})
    for (Method method : all_methods)
      for (int velocity_iterations : {0, 1, 4}) {
        if (kinematic && (method == Method::pgs || method == Method::tgs))
          continue;  // sweeps of two rows are not exact
        SCOPED_TRACE(std::string(to_string(method)) +
                     (kinematic ? ", held by a kinematic drive" : ", held by a servo"));
        at_all_steps([&](auto scalar, double dt) {
          using S = decltype(scalar);
          StepSettings settings = physics::settings(method, 4, velocity_iterations, dt);
          Watch<S> watch(hanging(1.0, kinematic), settings);
          watch.run(2.0);
          EXPECT_NEAR(watch.position(0), sag(), sizeof(S) == 4 ? 2e-5 : 1e-6);
          EXPECT_LE(watch.speed(), sizeof(S) == 4 ? 1e-4 : 1e-6);
        });
      }
}

// With a damping ratio of 0.1 the coupling swings for any number of velocity iterations. Each step is one of implicit
// Euler on j0:
//     (I + h kd + h^2 kp) u' = I u + h (m g l cos q - kp q),  q' = q + h u'.
// At 1/120 s and below, j0 crosses its rest position three times in the first half second.
TEST(SoftCoupling, swings_with_little_damping_for_any_number_of_velocity_iterations) {
  for (Method method : {Method::pgs, Method::direct, Method::automatic})
    for (int velocity_iterations : {0, 1, 4}) {
      SCOPED_TRACE(std::string(to_string(method)) + " with " + std::to_string(velocity_iterations));
      at_all_steps([&](auto scalar, double dt) {
        using S = decltype(scalar);
        Watch<S> watch(hanging(0.1, false), physics::settings(method, 4, velocity_iterations, dt));
        double q = 0.0, u = 0.0, side = -1.0;
        int crossings = 0;
        watch.run(0.5, {}, [&] {
          u = (inertia * u + dt * (mass * g * arm * std::cos(q) - kp * q)) / (inertia + dt * kd(0.1) + dt * dt * kp);
          q += dt * u;
          ASSERT_NEAR(watch.position(0), q, sizeof(S) == 4 ? 1e-5 : 1e-6);
          if ((watch.position(0) - sag()) * side < 0.0) ++crossings, side = -side;
        });
        if (dt <= 1.0 / 120) {
          EXPECT_GE(crossings, 3);
        }
      });
    }
}

}  // namespace
}  // namespace lockstep::stability
