// Stars, series, extreme masses and ratios: stiff trees of couplings stay sound. SPDX-License-Identifier: Apache-2.0
//
// Every scene is passive: it has gravity, drives with fixed targets, and damping. Its energy may grow by the error of
// the integrator (M45), a tenth of height_range(). chain8 gains as much in double precision when it falls from 1 rad
// off its couplings at 1/30 s.
#include "mechanisms.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

// `direct` adds impulses to the free velocity, whose rounding limits the precision of its couplings. It may exceed the
// tolerance by the factor `slack`. Cases for which `left_out` is true are not run.
void expect_passive_and_held(const Model& model, double seconds = 3.0, double slack = 1.0,
                             bool (*left_out)(int bytes, double dt, Method method) = nullptr) {
  with_exact_methods([&](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    if (left_out && left_out(sizeof(S), dt, method)) return;
    Watch<S> watch(model, recorded(dt, method));
    watch.run(seconds);
    expect_sound(watch, 0.1 * height_range(model), hard_tolerance<S> * (method == Method::direct ? slack : 1.0));
  });
}

TEST(CoupledMechanism, star_of_up_to_32_followers_holds) {
  for (int followers : {4, 8, 12, 24, 32})
    for (const char* carrier : {"base", "l0"}) {
      SCOPED_TRACE(std::to_string(followers) + " followers on " + carrier);
      expect_passive_and_held(star(followers, carrier), 1.0);
    }
}

TEST(CoupledMechanism, serial_arm_of_joints_that_mimic_each_other_holds) {
  const auto left_out = [](int bytes, double dt, Method method) {  // has an error of 2.015e-5: see known_test.cpp
    return bytes == 4 && dt == 1.0 / 30 && method == Method::direct;
  };
  expect_passive_and_held(serial(), 3.0, 2.0, left_out);  // while errors of 1 rad decay; later the error is 2e-6
}

TEST(CoupledMechanism, last_four_links_of_200_mg_stay_with_their_leaders) {
  expect_passive_and_held(with_masses([](int i) { return i < 4 ? 0.2 : 2e-4; }));
}

TEST(CoupledMechanism, links_of_200_kg_and_200_g_in_turn_hold_their_couplings) {
  expect_passive_and_held(with_masses([](int i) { return i % 2 == 0 ? 200.0 : 0.2; }));
}

TEST(CoupledMechanism, gear_ratios_from_a_thousandth_to_a_thousand_hold) {
  for (double ratio : {0.001, 0.01, 1.0, 100.0, 1000.0}) {
    SCOPED_TRACE(ratio);
    expect_passive_and_held(geared(ratio), 3.0, ratio == 1000.0 ? 3.0 : 1.0);
  }
}

TEST(CoupledMechanism, chain8_returns_from_errors_of_1_rad_without_unexplained_energy) {
  Model model = scenes::chain8();
  for (const Coupling& coupling : model.couplings)
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position += 1.0;
  expect_passive_and_held(model);
}

// All angles are the same q, so link k of 17 points down by k q, and sin(k q) lowers it and the links behind it. At
// rest the potential energy is least, and its derivative with respect to q is zero.
TEST(CoupledMechanism, serial_arm_rests_in_equilibrium) {
  const auto slope = [](double q) {
    double sum = 0.0;
    for (int k = 1; k <= 17; ++k) sum += (17 - k + 0.5) * k * std::cos(k * q);  // 17 - k links and half of link k
    return sum;
  };
  double low = 0.1, high = 0.25;
  ASSERT_GT(slope(low) * -slope(high), 0.0);
  while (high - low > 1e-12) (slope(0.5 * (low + high)) * slope(low) > 0.0 ? low : high) = 0.5 * (low + high);

  Model model = serial();
  for (Joint& joint : model.joints) joint.damping = 1.0;
  with_exact_methods([&](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    if (dt < 1.0 / 60) return;  // it takes two minutes to come to rest
    Watch<S> watch(model, recorded(dt, method));
    watch.run(130.0);
    EXPECT_NEAR(watch.position(0), low, 1e-5);
    EXPECT_LE(watch.speed(), 1e-4);
  });
}

// The tests must notice couplings that do not hold: one sweep leaves this arm open.
TEST(CoupledMechanism, serial_arm_opens_with_one_sweep) {
  Watch<float> watch(serial(), [] {
    StepSettings settings = recorded(1.0 / 240, Method::pgs);
    settings.iterations = 1;
    return settings;
  }());
  watch.run(1.0);
  EXPECT_GT(watch.error(), 1e-2);
  EXPECT_GT(watch.late_error(), 1e-2);
}

// Angles of continuous joints are not wrapped, so a coupling holds over any number of turns. Its error may be one unit
// in the last place of each angle.
TEST(CoupledMechanism, continuous_joints_stay_coupled_over_many_turns) {
  with_exact_methods([](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    Watch<S> watch(turning(), recorded(dt, method));
    watch.run(10.0, {}, [&] {
      const double angle = watch.position(0), last_place = std::numeric_limits<S>::epsilon() * std::abs(angle);
      ASSERT_LE(watch.batch.coupling_errors().abs()(0, 0), 1e-6 + 2.0 * last_place);
    });
    EXPECT_GT(watch.position(1), 20.0 * 2.0 * M_PI);
    EXPECT_EQ(watch.batch.faulted(), 0);
    EXPECT_LE(watch.excess(), 1e-6);
  });
}

}  // namespace
}  // namespace lockstep::stability
