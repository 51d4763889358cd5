// A gripper of coupled pads, a finger at a wall, and legs. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "contact_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

template <class S>
struct Machines : testing::Test {
  static constexpr bool is_double = sizeof(S) == 8;
};
using Precisions = testing::Types<double, float>;
TYPED_TEST_SUITE(Machines, Precisions);

/// What a grasp came to, in the first environment.
struct Held {
  double slip = 0.0, turn = 0.0;  ///< of the object in the palm's frame, from 1 s on
  double deepest = 0.0;           ///< of a pad in the object, before the object slips
  double wrist_closing = 0.0;     ///< largest angle while the pads close
  double coupling = 0.0;          ///< largest error
  bool faulty = false;
};

template <class S>
Held run(const Grasp& grasp, double seconds, double dt = 1.0 / 240) {
  StepSettings settings;
  settings.dt = dt;
  const Plan plan = compile(grasp.model(), settings);
  Batch<S> batch(plan, 2, {.threads = 1});
  const int y = plan.dof("y"), z = plan.dof("z"), wrist = plan.dof("wrist"), left = plan.dof("left"),
            right = plan.dof("right");
  Held held;
  Eigen::Isometry3d first = Eigen::Isometry3d::Identity();
  bool kept = false;
  for (int i = 0; i < static_cast<int>(seconds / dt); ++i) {
    const double t = (i + 1) * dt;
    const Eigen::Vector4d targets = grasp.targets(t);
    const int rows[] = {y, z, wrist, left};
    for (int k = 0; k < 4; ++k) batch.position_targets().row(rows[k]) = static_cast<S>(targets[k]);
    batch.step(1);
    const Eigen::ArrayXd q = batch.positions().col(0).template cast<double>(),
                         pose = batch.root_poses().col(0).template cast<double>();
    Eigen::Isometry3d palm = Eigen::Isometry3d::Identity(), object = palm;
    palm.translation() = Eigen::Vector3d(0, q[y], 0.03 + q[z]);
    palm.linear() = Eigen::AngleAxisd(q[wrist], Eigen::Vector3d::UnitZ()).toRotationMatrix();
    object.translation() = Eigen::Vector3d(pose[0], pose[1], pose[2]);
    object.linear() = Eigen::Quaterniond(pose[3], pose[4], pose[5], pose[6]).normalized().toRotationMatrix();
    const Eigen::Isometry3d seen = palm.inverse() * object;
    if (t < 0.5) held.wrist_closing = std::max(held.wrist_closing, std::abs(q[wrist]));
    if (t >= 1.0 && !kept) first = seen, kept = true;
    if (kept) {
      held.slip = std::max(held.slip, (seen.translation() - first.translation()).norm());
      held.turn = std::max(held.turn, Eigen::AngleAxisd(first.linear().transpose() * seen.linear()).angle());
      held.deepest = std::max(held.deepest, q[left] - 0.03);
    }
    held.coupling = std::max(held.coupling, std::abs(q[left] - q[right]));
  }
  held.faulty = batch.faults()[0] != Fault::none;
  return held;
}

TYPED_TEST(Machines, a_grasp_holds_from_one_gram_to_one_kilogram) {
  for (const double mass : {0.001, 0.1, 1.0}) {
    const Held held = run<TypeParam>({mass}, 11.0);
    EXPECT_LT(held.slip, 1e-5) << mass;
    EXPECT_LT(held.turn, 1e-5) << mass;
    EXPECT_LT(held.deepest, mass < 0.01 ? 1e-3 : 2e-5) << mass;
    EXPECT_LT(held.wrist_closing, 1e-8) << mass;
    EXPECT_LT(held.coupling, 1e-12) << mass;
    EXPECT_FALSE(held.faulty);
  }
}

// At the peaks the load is above what friction can carry, so the box slips a little each time.
TYPED_TEST(Machines, a_grasp_holds_ten_kilograms_for_some_seconds) {
  EXPECT_LT(run<TypeParam>({10.0}, 4.0).slip, 1e-3);
}

TYPED_TEST(Machines, a_grasp_slips_less_with_smaller_steps) {
  EXPECT_LT(run<TypeParam>({0.1}, 4.0, 1.0 / 60).slip, 1e-5);
  EXPECT_LT(run<TypeParam>({0.1}, 4.0, 1.0 / 480).slip, 1e-6);
}

// The object is at (3, 6) mm, so the right pad meets it first. What pushes that pad back, along +x at y = 6 mm, turns
// the palm about -z until the other pad meets it, too.
TYPED_TEST(Machines, an_object_off_centre_turns_a_free_wrist_and_rests) {
  Grasp grasp{0.1};
  grasp.wrist_driven = false, grasp.block_at = {0.003, 0.006, 0.02};
  const Plan plan = compile(grasp.model());
  Batch<TypeParam> batch(plan, 2, {.threads = 1});
  for (int i = 0; i < 960; ++i) {
    const Eigen::Vector4d targets = grasp.targets((i + 1) / 240.0);
    batch.position_targets().row(plan.dof("z")) = static_cast<TypeParam>(targets[1]);
    batch.position_targets().row(plan.dof("left")) = static_cast<TypeParam>(targets[3]);
    batch.step(1);
  }
  EXPECT_NEAR(static_cast<double>(batch.positions()(plan.dof("wrist"), 0)), -0.0035,
              0.0025);  // 1/3840 s: -0.0028 to -0.0040
  EXPECT_LT(std::abs(static_cast<double>(batch.velocities()(plan.dof("wrist"), 0))), this->is_double ? 1e-10 : 1e-5);
}

TYPED_TEST(Machines, a_stiff_finger_rests_at_a_wall) {
  for (const double limit : {1.2, 0.4703}) {
    const Plan plan = compile(wall(limit));
    Batch<TypeParam> batch(plan, 2, {.threads = 1});
    const int q1 = plan.dof("q1");
    double fastest = 0.0;
    for (int i = 0; i < 960; ++i) {
      batch.position_targets().row(q1) = static_cast<TypeParam>(0.05 + 0.7 * ramp((i + 1) / 240.0, 0.0, 0.5));
      batch.step(1);
      if (i >= 480) fastest = std::max(fastest, static_cast<double>(batch.velocities().abs().maxCoeff()));
    }
    EXPECT_LT(fastest, this->is_double ? 1e-8 : 1e-5);
    const double angle = static_cast<double>(batch.positions()(q1, 0));
    if (limit > 1.0) {
      EXPECT_NEAR(angle, 0.4714, 0.001);
    } else {
      EXPECT_EQ(static_cast<TypeParam>(angle), static_cast<TypeParam>(limit));
    }
    EXPECT_EQ(batch.faults()[0], Fault::none);
  }
}

TYPED_TEST(Machines, a_quadruped_stands) {
  Batch<TypeParam> batch(compile(quadruped()), 2, {.threads = 1});
  batch.step(720);
  const Eigen::Vector3d place = batch.root_poses().col(0).head(3).template cast<double>();
  double fastest = 0.0, drift = 0.0;
  for (int i = 0; i < 1680; ++i) {
    batch.step(1);
    fastest = std::max({fastest, static_cast<double>(batch.velocities().abs().maxCoeff()),
                        static_cast<double>(batch.root_velocities().abs().maxCoeff())});
    drift = std::max(drift, (batch.root_poses().col(0).head(3).matrix().template cast<double>() - place).norm());
  }
  EXPECT_LT(fastest, this->is_double ? 1e-10 : 1e-4);
  EXPECT_LT(drift, 1e-6);
  EXPECT_EQ(batch.faults()[0], Fault::none);
}

// Without feedback such a trot topples after some seconds; only large steps of euler keep it up.
TYPED_TEST(Machines, a_trot_leaves_the_feet_on_the_floor_and_the_knees_coupled) {
  const Plan plan = compile(quadruped());
  Batch<TypeParam> batch(plan, 2, {.threads = 1});
  const int hips[] = {plan.dof("fl_hip"), plan.dof("fr_hip"), plan.dof("hl_hip"), plan.dof("hr_hip")};
  std::vector<TypeParam> gaps(4 * 2);
  const Query query{Quantity::contact_gap};
  double deepest = 0.0;
  for (int i = 0; i < 720; ++i) {
    const Eigen::Vector4d targets = trot((i + 1) / 240.0);
    for (int k = 0; k < 4; ++k) batch.position_targets().row(hips[k]) = static_cast<TypeParam>(targets[k]);
    batch.step(1);
    batch.read(std::span(&query, 1), {gaps.data(), 2, 1});
    for (const TypeParam gap : gaps) deepest = std::min(deepest, static_cast<double>(gap));
  }
  EXPECT_GT(deepest, -2e-4);
  EXPECT_GT(static_cast<double>(batch.root_poses()(2, 0)), 0.34);
  EXPECT_LT(static_cast<double>(batch.coupling_errors().abs().maxCoeff()), this->is_double ? 1e-14 : 1e-6);
  EXPECT_EQ(batch.faults()[0], Fault::none);
}

}  // namespace
}  // namespace lockstep
