// The first step with contacts against the reference, which solves the dual problem. SPDX-License-Identifier:
// Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.h"
#include "physics.h"
#include "reference/contacts.h"

namespace lockstep {
namespace {

using namespace contact_scenes;

StepSettings tight(int velocity_iterations) {
  StepSettings settings;
  settings.contacts = {1, 200, 1e-12};                 // one pass: the reference allows for the slip of the start
  settings.velocity_iterations = velocity_iterations;  // 0: the velocity that moves the positions is the one that stays
  return settings;
}

// A ball on a box on the floor, a second ball beside them, and a capsule; all near each other and moving.
Model heap(unsigned seed) {
  std::mt19937 generator(seed);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  Model model;
  model.name = "heap";
  const auto mass = [&] { return std::pow(10.0, uniform(-1.0, 1.0)); };
  add_block(model, "box", mass(), {0.1, 0.12, 0.08}, {0, 0, 0.04 + uniform(-1e-3, 1e-3)}, uniform(0.2, 1.0));
  model.roots.back().pose.linear() =
      Eigen::AngleAxisd(uniform(-0.01, 0.01), Vector3d(uniform(-1, 1), uniform(-1, 1), 3).normalized())
          .toRotationMatrix();
  for (const auto& [name, place] :
       {std::pair("top", Vector3d(0.02, 0.01, 0.11)), std::pair("side", Vector3d(0.08, 0.0, 0.03))}) {
    const double m = mass();
    add_free(model, name, {m, Vector3d::Zero(), m * 3.6e-4 * Eigen::Matrix3d::Identity()}, Shape::sphere(0.03),
             place + Vector3d(0, 0, uniform(-1e-3, 1e-3)), uniform(0.2, 1.0));
  }
  const double m = mass();
  add_free(model, "rod", {m, Vector3d::Zero(), m * Vector3d(1e-3, 1e-3, 2e-4).asDiagonal().toDenseMatrix()},
           Shape::capsule(0.02, 0.1), {0.0, 0.3, 0.02}, uniform(0.2, 1.0));
  model.roots.back().pose.linear() = Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitY()).toRotationMatrix();
  add_floor(model, uniform(0.2, 1.0));
  model.contacts = {{"floor", "box"}, {"floor", "side"}, {"floor", "rod"}, {"box", "top"}, {"box", "side"}};
  for (Root& root : model.roots)
    for (int k = 0; k < 6; ++k) root.velocity[k] = uniform(-0.3, 0.3);
  return model;
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

// The heap's contacts take turns in being soft and in bouncing, and some begin deep inside of each other.
Model lively_heap(unsigned seed) {
  Model model = heap(seed);
  std::mt19937 generator(seed + 1000);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(generator);
  };
  for (Contact& contact : model.contacts) {
    if (uniform(0, 1) < 0.5) contact.restitution = uniform(0.1, 1.0);
    const double kind = uniform(0, 1);
    if (kind < 0.2)
      contact.softness = Spring{std::pow(10.0, uniform(2, 5)), std::pow(10.0, uniform(0, 2))};
    else if (kind < 0.4)
      contact.softness = Frequency{uniform(30, 300), uniform(0.1, 2.0)};
  }
  for (Root& root : model.roots) root.pose.translation().z() -= uniform(0.0, 4e-3);
  return model;
}

TEST(ContactAgreement, of_soft_bouncing_and_overlapping_heaps) {
  Seen seen;
  for (unsigned seed = 0; seed < 60; ++seed) {
    EXPECT_LT(difference(lively_heap(seed), 0, seen), 1e-7) << seed;
    EXPECT_LT(difference(lively_heap(seed), 1, seen), 1e-7) << seed;
  }
  EXPECT_GE(seen.pressing, 100);
  EXPECT_GE(seen.bouncing, 50);
  EXPECT_GE(seen.pushed, 30);
}

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

}  // namespace
}  // namespace lockstep
