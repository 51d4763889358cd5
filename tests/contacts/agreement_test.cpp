// The first step with contacts against the reference, which solves the dual problem. SPDX-License-Identifier:
// Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"
#include "heaps.h"
#include "physics.h"
#include "reference/contacts.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

StepSettings tight(int velocity_iterations) {
  StepSettings settings;
  settings.integrator = Integrator::euler;
  settings.contacts = {1, 200, 1e-12};                 // one pass: the reference allows for the slip of the start
  settings.velocity_iterations = velocity_iterations;  // 0: the velocity that moves the positions is the one that stays
  return settings;
}

// What the scenes of a test do.
struct Seen {
  int pressing = 0, bouncing = 0, pushed = 0;
};

// Returns the largest difference of the velocities after one step.
double difference(const Model& model, int velocity_iterations, Seen& seen) {
  const StepSettings settings = tight(velocity_iterations);
  const reference::Mechanism mechanism(model);
  const reference::State start = mechanism.initial_state();
  const reference::ContactStep truth = reference::contact_step(mechanism, settings, start, mechanism.initial_inputs());
  bool presses = false, bounces = false, pushed = false;
  for (std::size_t c = 0; c < truth.points.size(); ++c) {
    const reference::ContactPoint& point = truth.points[c];
    presses = presses || truth.impulses[c][0] > 0.0;
    bounces = bounces || point.restored > 0.0;
    pushed = pushed || (!point.soft && point.target < -0.01 && truth.impulses[c][0] > 0.0);
  }
  seen.pressing += presses, seen.bouncing += bounces, seen.pushed += pushed;
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  batch.step(1);
  reference::State end = mechanism.advanced(start, truth.velocity, settings.dt);
  end.v = velocity_iterations > 0 ? truth.stays : truth.velocity;
  mechanism.turn_axes(start, end);
  const reference::State ours = physics::state_of(batch);
  for (std::size_t r = 0; r < end.roots.size(); ++r)
    EXPECT_LT((ours.roots[r].position - end.roots[r].position).norm(), 1e-9);
  return physics::distance(ours.v, end.v);
}

TEST(ContactAgreement, of_the_positions_solve_of_random_heaps) {
  Seen seen;
  for (unsigned seed = 0; seed < 60; ++seed) EXPECT_LT(difference(heap(seed), 0, seen), 1e-8) << seed;
  EXPECT_GE(seen.pressing, 50);
}

// The search for nearest points ends where the separation is right to 1e-11, so the normal is right to its root.
TEST(ContactAgreement, of_cylinders_ellipsoids_and_hulls) {
  Seen seen;
  for (unsigned seed = 0; seed < 60; ++seed) EXPECT_LT(difference(solid_heap(seed), 0, seen), 2e-5) << seed;
  EXPECT_GE(seen.pressing, 50);
}

// The same on uneven ground: each point has the normal of its own triangle.
TEST(ContactAgreement, of_solids_on_a_height_field) {
  Seen seen;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Model model = solid_heap(seed);
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> height(-5e-4, 5e-4);
    Eigen::MatrixXd heights(61, 81);
    for (double& number : heights.reshaped()) number = height(generator);
    for (Collider& collider : model.colliders) {
      if (collider.name == "floor") collider.shape = Shape::height_field(heights, 4.0, 3.0);
      if (collider.name == "floor")
        collider.pose.linear() = Eigen::AngleAxisd(0.3, Vector3d::UnitZ()).toRotationMatrix();
    }
    EXPECT_LT(difference(model, 0, seen), 2e-5) << seed;
  }
  EXPECT_GE(seen.pressing, 50);
}

// Both the velocity that moves the positions and the one that stays.
Seen both_solves_agree(Model (*heap_of)(unsigned)) {
  Seen seen;
  for (unsigned seed = 0; seed < 60; ++seed)
    for (const int velocity_iterations : {0, 1})
      EXPECT_LT(difference(heap_of(seed), velocity_iterations, seen), 1e-7) << seed;
  EXPECT_GE(seen.pressing, 100);
  EXPECT_GE(seen.bouncing, 50);
  return seen;
}

TEST(ContactAgreement, of_soft_bouncing_and_overlapping_heaps) { EXPECT_GE(both_solves_agree(lively_heap).pushed, 30); }

// Cones of six dimensions, also of soft pairs, of rebounds and of several slots a pair.
TEST(ContactAgreement, of_heaps_that_resist_turning) { both_solves_agree(turning_heap); }

TEST(ContactAgreement, a_quadruped_with_coupled_knees_lands) {
  Seen seen;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Model model = quadruped();
    model.contacts.clear();
    for (const char* foot : {"fl_foot", "fr_foot", "hl_foot", "hr_foot"}) model.contacts.push_back({"floor", foot});
    model.roots[0].pose.translation().z() = 0.3705 + 0.001 * uniform(generator);
    for (int k = 0; k < 6; ++k) model.roots[0].velocity[k] = 0.5 * uniform(generator);
    model.roots[0].velocity[5] -= 0.5;
    EXPECT_LT(difference(model, 0, seen), 1e-8) << seed;
  }
  EXPECT_EQ(seen.pressing, 20);
}

// It takes each coupling's first joint for its follower, so it must not take one twice.
TEST(ContactAgreement, is_refused_for_two_couplings_of_one_first_joint) {
  Model model = scenes::chain8();
  model.couplings.push_back({model.couplings[0].joint, {{"j1", 0.5}}, 0.0, Hard{}});
  const reference::Mechanism mechanism(model);
  const auto step = [&] {
    reference::contact_step(mechanism, tight(0), mechanism.initial_state(), mechanism.initial_inputs());
  };
  EXPECT_THROW(step(), std::logic_error);
}

}  // namespace
}  // namespace lockstep
