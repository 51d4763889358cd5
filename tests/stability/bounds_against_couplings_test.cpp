// Limits, servos and friction act against a coupling, which must hold. SPDX-License-Identifier: Apache-2.0
#include "mechanisms.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

// Calls test(model) for links side by side and one on the other, with either joint as the first of the coupling.
template <class Test>
void for_every_pair(double ratio, Test&& test) {
  for (Arrangement arrangement : {Arrangement::side_by_side, Arrangement::second_on_first})
    for (bool swapped : {false, true}) {
      SCOPED_TRACE(arrangement == Arrangement::side_by_side ? "side by side" : "second on first");
      SCOPED_TRACE(swapped ? "j1 is the coupling's first joint" : "j0 is the coupling's first joint");
      Model model = pair(arrangement, ratio);
      if (swapped) model.couplings = {Coupling::mimic("j1", "j0", 1.0 / ratio)};
      test(model);
    }
}

// `direct` searches for active bounds with an inverse that contains the couplings (M61). With stiff servos or large
// gear ratios that is a small difference of large numbers. So in single precision only the milder cases are promised.
// In double precision the tolerance is 1e-4 for stiff servos with large ratios; the largest error is 4.7e-5, at 1/30 s.
template <class S>
bool promised(Method method, double ratio, double kp) {
  return method == Method::automatic || sizeof(S) == 8 || (kp < 1e3 && std::abs(ratio) < 10.0);
}
template <class S>
double coupling_tolerance(Method method, double ratio, double kp) {
  if (method == Method::automatic || sizeof(S) == 4) return hard_tolerance<S>;
  return kp < 1e3 || std::abs(ratio) < 10.0 ? 1e-8 : 1e-4;
}

// Joint `limited` has an upper limit, and a servo drives the other to `target`. Both must rest at the limit. The limit
// cancels the velocity kp / kd |target - q| that the servo alone would give. Its rounding stays, multiplied by the gear
// ratio for a fast joint.
void expect_rest_at_limit(double ratio, int limited, double limit, double target) {
  for_every_pair(ratio, [&](Model model) {
    const int driven = 1 - limited;
    const double other = limited == 0 ? limit / -ratio : limit * -ratio;  // q_0 = -ratio q_1
    model.joints[limited].upper = limit;
    for (double kp : {20.0, 1e6}) {
      SCOPED_TRACE("kp " + std::to_string(kp));
      model.joints[driven].drive = {kp, kp / 100.0, target, 0.0};
      with_exact_methods([&](auto scalar, double dt, Method method) {
        using S = decltype(scalar);
        if (!promised<S>(method, ratio, kp)) return;
        const double tolerance = coupling_tolerance<S>(method, ratio, kp);
        const double rounded = 4.0 * std::numeric_limits<S>::epsilon() * 100.0 * target * (limited == 0 ? -ratio : 1.0);
        Watch<S> watch(model, recorded(dt, method));
        watch.run(1.0);
        expect_sound(watch, 0.1 * height_range(model), tolerance);
        EXPECT_NEAR(watch.position(limited), limit, 1e-4);
        EXPECT_NEAR(watch.position(driven), other, 1e-4);
        EXPECT_LE(watch.batch.limit_violations()(0, 0), 1e-6 + rounded * dt);
        EXPECT_LE(watch.speed(), std::max(tolerance > 1e-6 ? 1e-3 : 1e-6, rounded));
        if (tolerance <= hard_tolerance<S> * 100.0) {
          EXPECT_TRUE(watch.batch.conflicts(0).empty());
        }
      });
    }
  });
}

TEST(BoundsAgainstCouplings, limit_of_one_joint_stops_the_servo_of_the_other) {
  expect_rest_at_limit(-1.0, 0, 0.1, 1.0);
}

TEST(BoundsAgainstCouplings, limit_of_a_fast_joint_stops_the_servo_of_the_slow_one) {
  expect_rest_at_limit(-100.0, 0, 0.1, 1.0);
}

TEST(BoundsAgainstCouplings, limit_of_a_slow_joint_stops_the_servo_of_the_fast_one) {
  expect_rest_at_limit(-100.0, 1, 0.01, 5.0);
}

TEST(BoundsAgainstCouplings, stiff_servos_with_opposite_targets_meet_in_the_middle) {
  for_every_pair(-1.0, [](Model model) {
    for (int i = 0; i < 2; ++i) model.joints[i].drive = {1e6, 1e3, i == 0 ? 0.3 : -0.3, 0.0};
    with_exact_methods([&](auto scalar, double dt, Method method) {
      using S = decltype(scalar);
      if (!promised<S>(method, 1.0, 1e6)) return;
      Watch<S> watch(model, recorded(dt, method));
      watch.run(1.0);
      expect_sound(watch, 0.1 * height_range(model));
      EXPECT_NEAR(watch.position(0), 0.0, 1e-4);
      EXPECT_NEAR(watch.position(1), 0.0, 1e-4);
      EXPECT_LE(watch.speed(), sizeof(S) == 4 ? 1e-5 : 1e-6);
    });
  });
}

// Joint 2 of chain8 may only be in [-0.35, 0.35], and joint 0, which mimics it, bears the load.
TEST(BoundsAgainstCouplings, limit_of_a_leader_bears_the_load_of_its_follower) {
  Model model = scenes::chain8();
  model.joints[2].lower = -0.35, model.joints[2].upper = 0.35;
  with_exact_methods([&](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Watch<S> watch(model, recorded(dt, method));
    watch.run(3.0, {}, [&] { ASSERT_LE(watch.batch.limit_violations()(0, 0), 1e-5); });
    expect_sound(watch, 0.1 * height_range(model));
    EXPECT_NEAR(watch.position(0), 0.35, 1e-5);
  });
}

// Friction stops both joints of the coupling, or lets them slip together.
TEST(BoundsAgainstCouplings, friction_never_opens_the_coupling) {
  for_every_pair(-1.0, [](Model model) {
    for (int joint : {0, 1})
      for (double friction : {0.1, 10.0, 1e3}) {
        SCOPED_TRACE("friction " + std::to_string(friction) + " on joint " + std::to_string(joint));
        Model with_friction = model;
        with_friction.joints[joint].friction = friction;
        with_friction.joints[1 - joint].drive = {100.0, 10.0, 1.0, 0.0};
        with_exact_methods([&](auto scalar, double dt, Method method) {
          using S = decltype(scalar);
          if (!promised<S>(method, 1.0, friction)) return;
          Watch<S> watch(with_friction, recorded(dt, method));
          watch.run(1.0);
          expect_sound(watch, 0.1 * height_range(with_friction));
          if (friction < 1e3) {
            EXPECT_GT(watch.position(1 - joint), 0.5);
          } else {
            EXPECT_NEAR(watch.position(1 - joint), 0.0, 1e-6);
          }
        });
      }
  });
}

// The velocity of a sticking joint is exactly zero, with and without a coupling.
TEST(BoundsAgainstCouplings, friction_that_sticks_leaves_exactly_zero_velocity) {
  at_all_steps([](auto scalar, double dt) {
    using S = decltype(scalar);
    for (double gear : {0.0, 1.0, -1.0})
      for (double share : {0.99, -0.99, 0.1}) {
        SCOPED_TRACE(gear);
        Model model = sliding(2);
        if (gear != 0.0) model.couplings = {Coupling::mimic("s0", "s1", -gear)};
        model.joints[0].friction = gear == 0.0 ? 0.0 : 2.0, model.joints[1].friction = 5.0;
        Watch<S> watch(model, recorded(dt));
        watch.batch.efforts().row(1).setConstant(static_cast<S>(share * (gear == 0.0 ? 5.0 : 7.0)));
        watch.run(0.5, {}, [&] {
          ASSERT_TRUE((watch.batch.velocities() == S(0)).all());
          ASSERT_TRUE((watch.batch.positions() == S(0)).all());
        });
      }
  });
}

// s_0 = gear s_1. Friction F_0 and F_1 holds against an effort on s_1 up to gear F_0 + F_1 (M59). Beyond it, the rest
// of the effort accelerates a mass of 1 + gear^2.
TEST(BoundsAgainstCouplings, friction_holds_to_its_threshold_and_slips_beyond) {
  for (double gear : {1.0, 3.0})
    for (const auto& friction : {std::pair(5.0, 0.0), {0.0, 5.0}, {1e3, 7.0}}) {
      const double first = friction.first, second = friction.second;
      SCOPED_TRACE("gear " + std::to_string(gear) + ", friction " + std::to_string(first));
      Model model = sliding(2);
      model.couplings = {Coupling::mimic("s0", "s1", -gear)};
      model.joints[0].friction = first, model.joints[1].friction = second;
      const double threshold = gear * first + second, mass = 1.0 + gear * gear;
      with_exact_methods([&](auto scalar, double dt, Method method) {
        using S = decltype(scalar);
        if (!promised<S>(method, 1.0, first)) return;
        // Rounding of the effort per step. The inverse of direct (M61) amplifies it, to 1.7e-11 m/s at 1e3 N.
        const double places = method == Method::direct && first > 100.0 ? 1e4 : 16.0;
        const double rounded = places * std::numeric_limits<S>::epsilon() * threshold * dt;
        for (double share : {0.99, 1.01}) {
          Watch<S> watch(model, recorded(dt, method));
          watch.batch.efforts().row(1).setConstant(static_cast<S>(share * threshold));
          watch.run(0.5);
          const double slip = share < 1.0 ? 0.0 : (share - 1.0) * threshold / mass * watch.time();
          EXPECT_NEAR(watch.velocity(1), slip, rounded + 1e-4 * slip) << share;
          EXPECT_NEAR(watch.velocity(0), gear * slip, gear * (rounded + 1e-4 * slip)) << share;
          EXPECT_LE(watch.error(),
                    hard_tolerance<S> + 2.0 * std::numeric_limits<S>::epsilon() * std::abs(watch.position(0)));
        }
      });
    }
}

}  // namespace
}  // namespace lockstep::stability
