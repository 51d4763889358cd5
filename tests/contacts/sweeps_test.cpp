// pgs beside contacts: with many sweeps it finds what Newton's rounds find. SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "divergence_scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

constexpr int environments = 6;

/// The mean and the largest difference of velocities after single steps, over 1 + the largest velocity, along a motion
/// with random targets that `direct` makes. Both begin each step without memory.
struct Difference {
  double mean = 0.0, largest = 0.0;
};

Difference difference(const Model& model, int iterations, double amplitude) {
  StepSettings exact;
  exact.integrator = Integrator::euler, exact.method = Method::direct;
  exact.contacts.tolerance = 1e-9, exact.contacts.passes = 60;
  StepSettings swept = exact;
  swept.method = Method::pgs, swept.iterations = iterations, swept.velocity_iterations = iterations;
  Batch<double> motion(compile(model, exact), environments, {.threads = 1});
  Batch<double> by_rounds(motion.plan(), environments, {.threads = 1});
  Batch<double> by_sweeps(compile(model, swept), environments, {.threads = 1});
  std::mt19937 random(3);
  std::uniform_real_distribution<double> target(-amplitude, amplitude);
  Difference found;
  const int steps = 80;
  for (int i = 0; i < steps; ++i) {
    if (i % 12 == 0)
      for (const Joint& joint : model.joints)
        for (int e = 0; joint.drive.kp > 0.0 && e < environments; ++e) {
          const int dof = motion.plan().dof(joint.name);
          motion.position_targets()(dof, e) = joint.drive.position_target + target(random);
        }
    for (Batch<double>* batch : {&by_rounds, &by_sweeps}) {
      batch->reset();
      batch->positions() = motion.positions(), batch->velocities() = motion.velocities();
      batch->root_poses() = motion.root_poses(), batch->root_velocities() = motion.root_velocities();
      batch->position_targets() = motion.position_targets();
      batch->step(1);
      EXPECT_EQ(batch->faulted(), 0);
    }
    const auto parts = [](const Batch<double>& batch) {
      Eigen::ArrayXXd all(batch.velocities().rows() + batch.root_velocities().rows(), environments);
      all << batch.velocities(), batch.root_velocities();
      return all;
    };
    const Eigen::ArrayXXd exactly = parts(by_rounds);
    const double error = (parts(by_sweeps) - exactly).abs().maxCoeff() / (1.0 + exactly.abs().maxCoeff());
    found.mean += error / steps, found.largest = std::max(found.largest, error);
    motion.step(1);
  }
  return found;
}

Model with_friction(Model model, double friction) {
  for (Collider& collider : model.colliders) collider.friction = friction;
  return model;
}

TEST(Sweeps, find_what_rounds_find_where_nothing_rubs) {
  EXPECT_LT(difference(wall(), 250, 0.0).largest, 1e-10);
  EXPECT_LT(difference(with_friction(quadruped(), 0.0), 250, 0.3).largest, 1e-10);
  EXPECT_LT(difference(with_friction(limited_quadruped(false), 0.0), 1000, 0.5).largest, 1e-10);
}

// Slip passes end within 2.4e-3 m/s at this step (M105), so that much may lie between the two.
TEST(Sweeps, find_what_rounds_find_within_their_slip_where_something_rubs) {
  Model slides = block();
  slides.roots[0].velocity << 0, 0, 0, 3, 0, 0;
  Model rolls = ball({0, 0, 0.1});
  rolls.colliders[0].torsional_friction = 0.02, rolls.colliders[0].rolling_friction = 0.01;
  rolls.roots[0].velocity << 2, 10, 5, 1, 0, 0;
  for (const Model& model : {block(), slides, slope(0.99), slope(1.01)})
    EXPECT_LT(difference(model, 250, 0.0).largest, 1e-3) << model.name;
  EXPECT_LT(difference(rolls, 250, 0.0).largest, 2.4e-3);
  EXPECT_LT(difference(quadruped(), 1000, 0.3).mean, 2e-3);
  EXPECT_LT(difference(limited_quadruped(false), 1000, 0.5).mean, 2e-3);
}

TEST(Sweeps, few_of_them_leave_an_error_that_more_make_smaller) {
  const double few = difference(quadruped(), 4, 0.3).mean, more = difference(quadruped(), 64, 0.3).mean;
  EXPECT_GT(few, 1e-2);
  EXPECT_LT(more, 0.1 * few);
}

TEST(Sweeps, of_tgs_do_not_take_contacts) {
  StepSettings settings;
  settings.method = Method::tgs;
  EXPECT_THROW(compile(block(), settings), SettingsError);
}

}  // namespace
}  // namespace lockstep
