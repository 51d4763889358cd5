// Stars, series, far-off masses and ratios: stiff trees of couplings stay sound. SPDX-License-Identifier: Apache-2.0
//
// Every scene is passive: gravity, springs of drives that stand still, damping. What its energy may gain from nowhere
// is the integrator's own error (M45): up to a tenth of what the heights of its links can make of difference, which is
// what it is in double precision, too, where chain8 falls from 1 rad off its couplings at 1/30 s.
#include "mechanisms.h"
#include "scenes/scenes.h"
#include "watch.h"

namespace lockstep::stability {
namespace {

//
// `direct` adds impulses to what joints do without them, so its couplings are as exact as that is rounded: `slack` is
// how much worse than 1e-5 a scene may be for it in single precision.
void expect_passive_and_held(const Model& model, double seconds = 3.0, double slack = 1.0,
                             bool (*left_out)(int bytes, double dt, Method method) = nullptr) {
  with_exact_methods([&](auto scalar, double dt, Method method) {
    using S = decltype(scalar);
    if (left_out && left_out(sizeof(S), dt, method)) return;
    Watch<S> watch(model, recorded(dt, method));
    watch.run(seconds);
    expect_sound(watch, 0.1 * height_range(model), held<S> * (method == Method::direct ? slack : 1.0));
  });
}

TEST(Mechanism, star_of_32_followers_stays_bounded) {
  for (int followers : {4, 8, 12, 24, 32})
    for (const char* carrier : {"base", "l0"}) {
      SCOPED_TRACE(std::to_string(followers) + " followers on " + carrier);
      expect_passive_and_held(star(followers, carrier), 1.0);
    }
}

TEST(Mechanism, serial_arm_whose_joints_mimic_each_the_one_before_holds) {
  const auto known = [](int bytes, double dt, Method method) {  // to be 2.015e-5 off: see known_test.cpp
    return bytes == 4 && dt == 1.0 / 30 && method == Method::direct;
  };
  expect_passive_and_held(serial(), 3.0, 2.0, known);  // on the way back from 1 rad; 2e-6 after it
}

TEST(Mechanism, last_four_links_of_200_mg_stay_with_their_leaders) {
  expect_passive_and_held(weighing([](int i) { return i < 4 ? 0.2 : 2e-4; }));
}

TEST(Mechanism, links_of_200_kg_and_200_g_in_turn_hold_their_couplings) {
  expect_passive_and_held(weighing([](int i) { return i % 2 == 0 ? 200.0 : 0.2; }));
}

TEST(Mechanism, gear_ratios_from_a_thousandth_to_a_thousand_hold) {
  for (double ratio : {0.001, 0.01, 1.0, 100.0, 1000.0}) {
    SCOPED_TRACE(ratio);
    expect_passive_and_held(geared(ratio), 3.0, ratio == 1000.0 ? 3.0 : 1.0);
  }
}

TEST(Mechanism, chain8_from_1_rad_off_comes_back_without_energy_from_nowhere) {
  Model model = scenes::chain8();
  for (const Coupling& coupling : model.couplings)
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position += 1.0;
  expect_passive_and_held(model);
}

// All angles are the same q, so link k of 17 points down by k q and lowers itself and the links behind it by its sine.
// At rest this is most: its derivative by q is 0.
TEST(Mechanism, serial_arm_rests_where_gravity_and_couplings_say) {
  const auto slope = [](double q) {
    double sum = 0.0;
    for (int k = 1; k <= 17; ++k) sum += (17 - k + 0.5) * k * std::cos(k * q);  // 17 - k links and half its own
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

// What the suite would see if couplings did not hold: one sweep leaves a series open.
TEST(Mechanism, series_breaks_where_rows_are_swept_once) {
  Watch<float> watch(serial(), [] {
    StepSettings settings = recorded(1.0 / 240, Method::pgs);
    settings.iterations = 1;
    return settings;
  }());
  watch.run(1.0);
  EXPECT_GT(watch.error(), 1e-2);
  EXPECT_GT(watch.late_error(), 1e-2);
}

// Angles of continuous joints are not wrapped, so that a coupling holds over any number of turns: as well as a float
// can say such an angle, a unit in the last place for each of the two.
TEST(Mechanism, continuous_joints_stay_coupled_over_many_turns) {
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
