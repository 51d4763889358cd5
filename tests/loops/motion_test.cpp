// Mechanisms with loops in motion: how well they stay closed, their energy, and the order of their errors.
// SPDX-License-Identifier: Apache-2.0
#include "loop_runs.h"

namespace lockstep {
namespace {

using namespace loop_models;
using namespace loop_runs;

constexpr double minute = 60.0;

template <class S>
class Loops : public testing::Test {
 protected:
  static constexpr bool is_double = sizeof(S) == 8;
};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Loops, Precisions);

template <class S>
void expect_closed(const Model& model, Integrator integrator, double seconds, double most, double gain) {
  const Run found = run<S>(model, settings(integrator), seconds);
  EXPECT_EQ(found.faulted, 0) << found.why;
  EXPECT_LT(found.gap, most) << model.name;
  EXPECT_LT(found.gain, gain) << model.name;
}

// Bars of a prototype in double, and what single precision adds.
TYPED_TEST(Loops, of_a_four_bar_stay_closed_for_a_minute) {
  const Model model = turning_for_ever(four_bar());
  expect_closed<TypeParam>(model, Integrator::euler, minute, 6e-5, 0.03);
  expect_closed<TypeParam>(model, Integrator::leapfrog, minute, this->is_double ? 3e-7 : 6e-7, 6e-4);
}

TYPED_TEST(Loops, of_a_slider_crank_stay_closed_for_a_minute) {
  const Model model = turning_for_ever(slider_crank());
  expect_closed<TypeParam>(model, Integrator::euler, minute, 1.6e-4, 0.03);
  expect_closed<TypeParam>(model, Integrator::leapfrog, minute, 2e-6, 0.03);
}

// The two cranks fold flat with their rods again and again.
TYPED_TEST(Loops, of_a_five_bar_go_through_singular_poses_for_a_minute) {
  const Model model = turning_for_ever(five_bar());
  expect_closed<TypeParam>(model, Integrator::euler, minute, 2e-3, 0.1);
  expect_closed<TypeParam>(model, Integrator::leapfrog, minute, 6e-4, 0.015);
}

TYPED_TEST(Loops, of_a_stewart_platform_stay_closed) {
  expect_closed<TypeParam>(stewart(), Integrator::euler, 10.0, 6e-6, 0.03);
  expect_closed<TypeParam>(stewart(), Integrator::leapfrog, 10.0, this->is_double ? 2e-9 : 6e-7, 0.03);
}

TYPED_TEST(Loops, of_a_gripper_with_springs_and_a_mimic_stay_closed_for_a_minute) {
  Model model = gripper();
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<TypeParam> batch(compile(model, settings(integrator)), 1, {.threads = 1});
    const Run found = run(batch, minute);
    EXPECT_EQ(found.faulted, 0) << found.why;
    EXPECT_LT(found.gap, 1e-5);
    EXPECT_LT(batch.coupling_errors().abs().maxCoeff(), this->is_double ? 1e-12 : 2e-7);
    // In single precision a lever of 0.025 m corrects what rounding leaves, 1e-7 m, in a step of 1/240 s.
    EXPECT_LT(batch.velocities().abs().maxCoeff(), this->is_double ? 1e-9 : 1e-7 * 240 / 0.025);
  }
}

TYPED_TEST(Loops, of_a_parallelogram_pass_where_it_is_flat) {
  const Model model = turning_for_ever(parallelogram());
  expect_closed<TypeParam>(model, Integrator::euler, 5.0, 2e-3, 0.1);
  expect_closed<TypeParam>(model, Integrator::leapfrog, 5.0, this->is_double ? 1e-8 : 2e-4, 0.1);
}

// A crank longer than the others can reach is stopped where coupler and rocker are in line. The rocker whips round at
// up to 124 rad/s then, half a radian in a step: what euler opens by falls with the square of the step, at least.
TYPED_TEST(Loops, stop_a_crank_in_the_dead_centre) {
  Model model =
      turning_for_ever(four_bar({.ground = 0.4, .crank = 0.3, .coupler = 0.3, .rocker = 0.3, .start = {1.0, 0.0}}));
  model.joints[0].drive = {.kp = 60.0, .kd = 3.0, .position_target = -2.5};
  const auto gap = [&](Integrator integrator, double dt) {
    const Run found = run<TypeParam>(model, settings(integrator, dt), 5.0);
    EXPECT_EQ(found.faulted, 0) << found.why;
    return found.gap;
  };
  EXPECT_LT(gap(Integrator::leapfrog, 1.0 / 240), 1e-3);
  const double euler = gap(Integrator::euler, 1.0 / 240);
  EXPECT_LT(euler, 1e-2);
  EXPECT_LT(gap(Integrator::euler, 1.0 / 960), euler / 16.0);
}

// 12 rows, of which 6 are independent.
TYPED_TEST(Loops, that_are_redundant_come_to_rest) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    Batch<TypeParam> batch(compile(bar_on_arms(), settings(integrator)), 1, {.threads = 1});
    const Run found = run(batch, 20.0);
    EXPECT_EQ(found.faulted, 0) << found.why;
    EXPECT_LT(found.gap, 1e-6);
    EXPECT_LT(batch.velocities().abs().maxCoeff(), this->is_double ? 1e-10 : 1e-4);
  }
}

// Rows that are held twice share their impulse, and nothing else changes.
TEST(Loop, that_stands_twice_moves_like_one) {
  for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) {
    const Model once = turning_for_ever(four_bar()), twice = turning_for_ever(four_bar({.loops = 2}));
    Batch<double> one(compile(once, settings(integrator)), 1, {.threads = 1}),
        two(compile(twice, settings(integrator)), 1, {.threads = 1});
    for (int i = 0; i < 240; ++i) one.step(1), two.step(1);
    EXPECT_LT((one.positions() - two.positions()).abs().maxCoeff(), 1e-9);
    EXPECT_NEAR(energy(one), energy(two), 1e-9);
  }
}

// A hinge is two points on its axis, one row of which is redundant.
TEST(Loop, of_a_hinge_moves_like_two_points_on_its_axis) {
  Model hinge = turning_for_ever(four_bar({.kind = LoopKind::hinge})), points = turning_for_ever(four_bar());
  points.loops.push_back(points.loops[0]);
  points.loops[1].name = "other";
  for (Pose* pose : {&points.loops[1].first_pose, &points.loops[1].second_pose})
    pose->translation() += 0.1 * loop_models::turning;
  Batch<double> one(compile(hinge, settings(Integrator::leapfrog)), 1, {.threads = 1}),
      two(compile(points, settings(Integrator::leapfrog)), 1, {.threads = 1});
  one.step(480), two.step(480);
  EXPECT_LT((one.positions() - two.positions()).abs().maxCoeff(), 1e-8);
}

// The block on a rod whose slider is in the world moves as the block on a slider whose point is at the rod.
TEST(Loop, of_a_slider_moves_like_a_sliding_joint) {
  Batch<double> by_slider(
      compile(turning_for_ever(slider_crank(LoopKind::slider)), settings(Integrator::leapfrog, 1.0 / 3840)), 1,
      {.threads = 1}),
      by_joint(compile(turning_for_ever(slider_crank()), settings(Integrator::leapfrog, 1.0 / 3840)), 1,
               {.threads = 1});
  by_slider.step(3840), by_joint.step(3840);
  EXPECT_NEAR(by_slider.positions()(0, 0), by_joint.positions()(0, 0), 1e-4);
}

// Against steps so small that their error does not count, Richardson's ratio of the crank's angle after 1 s.
TEST(Loop, has_errors_of_first_order_by_euler_and_of_second_by_leapfrog) {
  const Model model = turning_for_ever(four_bar());
  const auto crank = [&](Integrator integrator, double rate) {
    Batch<double> batch(compile(model, settings(integrator, 1.0 / rate)), 1, {.threads = 1});
    batch.step(static_cast<int>(rate));
    return batch.positions()(0, 0);
  };
  const double truth = (4.0 * crank(Integrator::leapfrog, 15360) - crank(Integrator::leapfrog, 7680)) / 3.0;
  const auto ratio = [&](Integrator integrator) {
    return (crank(integrator, 480) - truth) / (crank(integrator, 960) - truth);
  };
  EXPECT_GT(ratio(Integrator::euler), 1.8);
  EXPECT_LT(ratio(Integrator::euler), 2.2);
  EXPECT_GT(ratio(Integrator::leapfrog), 3.5);
  EXPECT_LT(ratio(Integrator::leapfrog), 4.5);
}

}  // namespace
}  // namespace lockstep
