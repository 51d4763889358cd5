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

StepSettings tight(int passes) {
  StepSettings settings;
  settings.contacts = {passes, 200, 1e-11};
  settings.velocity_iterations = 0;  // the velocity that moves the positions is the one that stays
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

// Returns the largest difference of the velocities after one step. `pressing` counts the scenes with an impulse.
double difference(const Model& model, int passes, int& pressing) {
  const StepSettings settings = tight(passes);
  const reference::Mechanism mechanism(model);
  const reference::State start = mechanism.initial_state();
  const reference::ContactStep truth =
      reference::contact_step(mechanism, settings, start, mechanism.initial_inputs(), passes);
  bool presses = false;
  for (const Vector3d& impulse : truth.impulses) presses = presses || impulse[0] > 0.0;
  pressing += presses;
  Batch<double> batch(compile(model, settings), 1, {.threads = 1});
  batch.step(1);
  reference::State end = mechanism.advanced(start, truth.velocity, settings.dt);
  end.v = truth.velocity;
  mechanism.turn_axes(start, end);
  const reference::State ours = physics::state_of(batch);
  return physics::distance(ours.v, end.v);
}

TEST(ContactAgreement, one_pass_of_random_heaps) {
  int pressing = 0;
  for (unsigned seed = 0; seed < 60; ++seed) EXPECT_LT(difference(heap(seed), 1, pressing), 1e-8) << seed;
  EXPECT_GE(pressing, 50);
}

TEST(ContactAgreement, a_quadruped_with_coupled_knees_lands) {
  int pressing = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 generator(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    Model model = quadruped();
    model.contacts.clear();
    for (const char* foot : {"fl_foot", "fr_foot", "hl_foot", "hr_foot"}) model.contacts.push_back({"floor", foot});
    model.roots[0].pose.translation().z() = 0.3705 + 0.001 * uniform(generator);
    for (int k = 0; k < 6; ++k) model.roots[0].velocity[k] = 0.5 * uniform(generator);
    model.roots[0].velocity[5] -= 0.5;
    EXPECT_LT(difference(model, 1, pressing), 1e-8) << seed;
  }
  EXPECT_EQ(pressing, 20);
}

}  // namespace
}  // namespace lockstep
