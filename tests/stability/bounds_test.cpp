// Bounds give the positions, velocities and forces of theory. SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

// A mass that falls along z from `height` onto its lower limit.
Model falling(double height, double restitution) {
  Model model = sliding(1);
  model.gravity = {0.0, 0.0, -9.81};
  model.joints[0].axis = Eigen::Vector3d::UnitZ();
  model.joints[0].position = height;
  model.joints[0].lower = 0.0;
  model.joints[0].restitution = restitution;
  return model;
}

TEST(Bounds, limit_stops_a_fall_without_bounce_and_without_jitter) {
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Watch<S> watch(falling(1.0, 0.0), recorded(dt, method));
    bool landed = false;
    watch.run(2.0, {}, [&] {
      ASSERT_GE(watch.position(0), -1e-6);
      if (landed) {
        ASSERT_LE(watch.position(0), 1e-6);
        ASSERT_LE(watch.speed(), 1e-6);
      }
      landed = landed || (watch.position(0) < 1e-6 && watch.speed() < 1e-6);
    });
    EXPECT_TRUE(landed);
    EXPECT_LE(watch.excess(), 1e-4 + 9.81 * 9.81 * 0.5 * dt * dt);
  });
}

TEST(Bounds, arm_on_its_limits_lies_still) {
  Model model = pair(Arrangement::second_on_first);
  model.joints[0].upper = 0.4;
  at_all_steps([&](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> watch(model, recorded(dt));
    watch.run(3.0);
    EXPECT_NEAR(watch.position(0), 0.4, 1e-6);
    for (int i = 0; i < 100; ++i) {
      watch.run(dt);
      ASSERT_LE(watch.speed(), 1e-6);
    }
    expect_sound(watch, 0.1 * height_range(model));
  });
}

// Each bounce has half the speed of the one before, up to twice the speed that gravity adds in a step. Heights shrink
// by the square.
TEST(Bounds, restitution_multiplies_heights_by_its_square) {
  at_all_steps([](auto scalar, double dt) {
    using S = decltype(scalar);
    Watch<S> watch(falling(1.0, 0.5), recorded(dt));
    const double e = 0.5, gravity = 9.81;
    std::vector<double> peaks = {1.0};
    double rising = -1.0, top = 0.0;
    watch.run(3.0, {}, [&] {
      ASSERT_GE(watch.position(0), -1e-6);
      if (watch.velocity(0) > 0.0) top = std::max(top, watch.position(0));
      if (rising > 0.0 && watch.velocity(0) <= 0.0) peaks.push_back(top), top = 0.0;
      rising = watch.velocity(0);
    });
    ASSERT_GE(peaks.size(), 2u);
    for (std::size_t i = 1; i < std::min<std::size_t>(peaks.size(), 4); ++i) {
      const double speed = std::sqrt(2.0 * gravity * peaks[i]), expected = e * std::sqrt(2.0 * gravity * peaks[i - 1]);
      EXPECT_NEAR(speed, expected, 2.0 * gravity * dt) << "bounce " << i;
    }
    EXPECT_NEAR(watch.position(0), 0.0, 1e-6);
    EXPECT_LE(watch.speed(), 1e-6);
  });
}

// Limits either the leader or its follower, which is three times as fast.
TEST(Bounds, velocity_limits_hold_to_the_last_digit) {
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    for (int limited : {0, 1}) {
      Model model = sliding(2);
      model.couplings = {Coupling::mimic("s0", "s1", -3.0)};
      model.joints[static_cast<std::size_t>(limited)].velocity_limit = 0.7;
      model.joints[1].effort = 50.0;
      Watch<S> watch(model, recorded(dt, method));
      const double last_places = 8.0 * std::numeric_limits<S>::epsilon();
      watch.run(1.0, {}, [&] { ASSERT_LE(std::abs(watch.velocity(limited)), 0.7 * (1.0 + last_places)); });
      EXPECT_NEAR(watch.velocity(limited), 0.7, 0.7 * last_places);
      EXPECT_LE(watch.error(), hard_tolerance<S>);
    }
  });
}

// Far from its target, a limited servo of any stiffness gives a constant force F, so v_n = n h F / m. An effort does
// not change that. At no time may the servo accelerate the mass more than its limit can.
TEST(Bounds, servo_never_exceeds_its_effort_limit) {
  for (double kp : {100.0, 1e6})
    for (double feed_forward : {0.0, 2.0, -5.0})
      with_exact_methods([&](auto scalar, double dt, Method method) {
        using S = decltype(scalar);
        Model model = sliding(1);
        model.joints[0].drive = {kp, kp / 10.0, 4.0, 0.0};
        model.joints[0].effort = feed_forward;
        model.joints[0].effort_limit = 3.0;
        Watch<S> watch(model, recorded(dt, method));
        double before = 0.0;
        int step = 0;
        watch.run(4.0, {}, [&] {
          ++step;
          const double rounded = 1e2 * std::numeric_limits<S>::epsilon() * (1.0 + std::abs(before));
          ASSERT_LE(std::abs(watch.velocity(0) - before), 3.0 * dt + rounded);
          if (step * dt < 0.5) {
            ASSERT_NEAR(watch.velocity(0), 3.0 * dt * step, 3.0 * dt * step * 1e-5);
          }
          before = watch.velocity(0);
        });
        expect_sound(watch, 1e-4);
      });
}

// s_0 = 2 s_1, and a drive prescribes s_1. The motion is exact up to rounding, with either joint first in the coupling.
TEST(Bounds, kinematic_drive_moves_the_coupled_joint_exactly) {
  for (bool swapped : {false, true})
    with_exact_methods([&](auto scalar, double dt, Method method) {
      using S = decltype(scalar);
      Model model = sliding(2);
      model.couplings = {swapped ? Coupling::mimic("s1", "s0", -0.5) : Coupling::mimic("s0", "s1", -2.0)};
      model.joints[0].friction = 5.0;
      model.joints[1].drive.kinematic = true;
      Watch<S> watch(model, recorded(dt, method));
      double target = 0.0;
      watch.run(
          2.0,
          [&](double t) {
            target = 0.5 * std::sin(3.0 * t);
            watch.batch.position_targets().row(1).setConstant(static_cast<S>(target));
            watch.batch.velocity_targets().row(1).setConstant(static_cast<S>(1.5 * std::cos(3.0 * t)));
          },
          [&] {
            ASSERT_NEAR(watch.position(1), target, sizeof(S) == 4 ? 2e-6 : 1e-10);
            ASSERT_NEAR(watch.position(0), 2.0 * target, sizeof(S) == 4 ? 4e-6 : 1e-10);
          });
      EXPECT_TRUE(watch.batch.conflicts(0).empty());
    });
}

// s_0 = gear s_1 with an effort F on s_1. The force of the coupling on s_0 is gear F / (1 + gear^2), and below its
// limit the coupling holds. Beyond it, the limit drives s_0, and F minus gear times the limit drives s_1.
TEST(Bounds, coupling_with_a_force_limit_holds_to_it_and_slips_beyond) {
  constexpr double gear = 2.0, most = 3.0;
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    for (double share : {0.99, 1.01, 2.0}) {
      SCOPED_TRACE(share);
      Model model = sliding(2);
      model.couplings = {Coupling::mimic("s0", "s1", -gear)};
      model.couplings[0].force_limit = most;
      const double effort = share * most * (1.0 + gear * gear) / gear;
      model.joints[1].effort = effort;
      StepSettings settings = recorded(dt, method);
      Watch<S> watch(model, settings);
      watch.run(0.5);
      const double t = watch.time();
      const double first = share < 1.0 ? effort * gear / (1.0 + gear * gear) : most;
      const double second = share < 1.0 ? effort / (1.0 + gear * gear) : effort - gear * most;
      EXPECT_NEAR(watch.velocity(0), first * t, 1e-4 * first * t);
      EXPECT_NEAR(watch.velocity(1), second * t, 1e-4 * second * t);
      if (share < 1.0) {
        EXPECT_LE(watch.error(), hard_tolerance<S>);
      }
      EXPECT_EQ(std::abs(watch.batch.row_states()(0, 0)), share < 1.0 ? S(1) : S(2));
    }
  });
}

// Three environments: the coupling is always on, off, and switched on later.
TEST(Bounds, switched_couplings_hold_where_they_are_on) {
  at_all_steps([](auto scalar, double dt) {
    using S = decltype(scalar);
    Model model = pair(Arrangement::second_on_first), free = model;
    free.couplings.clear();
    StepSettings settings = recorded(dt);
    settings.per_environment = {Parameter::coupling_switch};
    Watch<S> watch(model, settings, 3);
    Watch<S> uncoupled(free, recorded(dt));
    auto on = watch.batch.parameter(Parameter::coupling_switch);
    on << S(1), S(0), S(0);
    watch.run(0.25, {}, [&] { ASSERT_LE(std::abs(watch.batch.coupling_errors()(0, 0)), hard_tolerance<S>); });
    uncoupled.run(0.25);
    for (int lane : {1, 2})
      for (int dof : {0, 1}) EXPECT_NEAR(watch.position(dof, lane), uncoupled.position(dof), 1e-5) << lane;
    EXPECT_GT(std::abs(watch.batch.coupling_errors()(0, 1)), 1e-2);
    double expected = watch.batch.coupling_errors()(0, 2);
    on(0, 2) = S(1);
    watch.run(3.0, {}, [&] {
      expected *= 0.8;
      ASSERT_NEAR(watch.batch.coupling_errors()(0, 2), expected, 1e-5);
      ASSERT_LE(std::abs(watch.batch.coupling_errors()(0, 0)), hard_tolerance<S>);
    });
    EXPECT_TRUE(watch.finite());
  });
}

}  // namespace
}  // namespace lockstep::stability
