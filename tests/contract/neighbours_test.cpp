// An environment moves, and is read, to the last bit as it does among copies of itself, whatever its neighbours do.
// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "contact_scenes.h"
#include "lockstep/error.h"
#include "neighbours.h"
#include "physics.h"
#include "scenes/any_model.h"

namespace lockstep {
namespace {

// Starts and efforts are random, and those of each environment.
template <class S>
void expect_none_matters(const Plan& plan, Engine engine, int steps, unsigned seed) {
  Batch<S> batch(plan, 8, {.threads = 1, .engine = engine, .seed = seed});
  batch.reset_random(EnvironmentSet::all(), {.spread = 0.5, .speed = 0.7});
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> effort(-2.0, 2.0);
  neighbours::expect_none_matters(batch, steps, [&](Batch<S>& b) {
    b.efforts() = b.efforts().unaryExpr([&](S) { return static_cast<S>(effort(random)); });
  });
}

// Two links that a slider closes to a loop, with a ball at its corner above the ground.
Model crank(double friction, double restitution) {
  using contact_scenes::at;
  const Inertia rod = Inertia::box(0.5, {0.3, 0.05, 0.05}, {0.15, 0.0, 0.0});
  Model model;
  model.links = {{"base", {}}, {"a", rod}, {"b", rod}, {"c", rod}};
  model.roots = {{.link = "base", .pose = at({0.0, 0.0, 0.02})}};
  const auto add = [&](const char* name, JointKind kind, const char* parent, const char* child, double x) {
    Joint joint;
    joint.name = name, joint.kind = kind, joint.parent = parent, joint.child = child, joint.origin = at({x, 0.0, 0.0});
    joint.axis = kind == JointKind::prismatic ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
    model.joints.push_back(joint);
  };
  add("first", JointKind::revolute, "base", "a", 0.0), add("second", JointKind::revolute, "a", "b", 0.3);
  add("slide", JointKind::prismatic, "base", "c", 0.5);
  model.joints[0].position = -0.3, model.joints[0].friction = friction;
  Loop pin;
  pin.name = "pin", pin.first = "c", pin.second = "b", pin.second_pose = at({0.3, 0.0, 0.0});
  model.loops = {pin};
  model.colliders = {{.name = "ground", .shape = Shape::half_space(), .restitution = restitution},
                     {.name = "ball", .link = "b", .shape = Shape::sphere(0.1)}};
  model.contacts = {{"ground", "ball"}};
  return model;
}

// A contact solves some lanes twice. The others keep which joints stick, and their loop closes without these.
TEST(Neighbours, change_no_bit_of_a_loop_beside_a_contact) {
  for (const double friction : {0.2, 1.0})
    for (const double restitution : {0.0, 0.5})
      for (const Integrator integrator : {Integrator::leapfrog, Integrator::euler}) {
        SCOPED_TRACE(fmt::format("{} {} {}", friction, restitution, to_string(integrator)));
        const Plan plan = compile(
            crank(friction, restitution),
            {.integrator = integrator, .record_efforts = true, .record_contacts = true, .record_accelerations = true});
        for (const char* name : {"loop_force", "joint_wrench", "contact_mean_force", "drive_effort_peak"}) {
          const auto readings = neighbours::readings_of(Batch<float>(plan, 1));
          EXPECT_TRUE(std::any_of(readings.begin(), readings.end(), [&](const auto& r) { return r.name == name; }))
              << name;
        }
        for (const Engine engine : physics::engines(plan)) {
          expect_none_matters<float>(plan, engine, 60, 1);
          expect_none_matters<double>(plan, engine, 60, 2);
        }
      }
}

// Only the first environment is beyond its soft end, and only in the first tile something is solved.
TEST(Neighbours, give_no_environment_the_rows_that_act_in_them) {
  Model model = crank(0.0, 0.0);
  model.loops.clear(), model.roots[0].pose = contact_scenes::at({0.0, 0.0, 2.0});
  model.joints[0].friction = model.joints[0].position = 0.0;
  for (Joint& joint : model.joints) joint.axis = Eigen::Vector3d::UnitZ();
  model.joints[0].lower = -0.5, model.joints[0].upper = 0.5, model.joints[0].limit_softness = Spring{200.0, 2.0};
  Batch<float> batch(compile(model, {.integrator = Integrator::euler, .record_diagnostics = true}), 40, {.threads = 1});
  batch.positions()(0, 0) = 0.6f;
  batch.step();
  EXPECT_NE(batch.row_states()(0, 0), 0.0f);
  EXPECT_TRUE((batch.row_states().rightCols(39) == 0.0f).all());
  // Nor what they work.
  Batch<double> still(batch.plan(), 2, {.threads = 1}), beside(batch.plan(), 2, {.threads = 1});
  still.velocities()(0, 0) = beside.velocities()(0, 0) = 1.0;
  beside.positions()(0, 1) = 0.6;
  still.step(), beside.step();
  EXPECT_TRUE((still.energy_balances().col(0) == beside.energy_balances().col(0)).all());
}

// A frozen environment has taken no step, whatever a tile before it has solved.
TEST(Neighbours, give_nothing_to_a_frozen_environment) {
  const Plan plan = compile(crank(0.2, 0.0), {.integrator = Integrator::euler, .record_diagnostics = true});
  for (const int others : {0, 3, 39}) {
    Batch<double> batch(plan, others + 1, {.threads = 1});
    batch.velocities().col(others).setConstant(std::nan(""));
    batch.step(2);
    ASSERT_NE(batch.faults()[static_cast<std::size_t>(others)], Fault::none);
    EXPECT_TRUE((batch.row_states().col(others) == 0.0).all()) << others;
    EXPECT_TRUE((batch.row_residuals().col(others) == 0.0).all()) << others;
    EXPECT_TRUE((contact_scenes::read(batch, Quantity::loop_force).col(others) == 0.0).all()) << others;
    EXPECT_TRUE(others == 0 || (batch.row_states().col(0) != 0.0).any());
  }
}

TEST(Neighbours, change_no_bit_of_random_models_of_every_feature) {
  int moved = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    SCOPED_TRACE(seed);
    const std::vector<std::uint8_t> bytes = scenes::bytes_of(seed);
    scenes::AnyModel any(bytes);
    const Model model = any.model();
    std::optional<Plan> plan;
    try {
      plan = compile(model, any.settings());
    } catch (const Error&) {  // refused
      continue;
    }
    const Engine engine = seed % 3 == 0 ? Engine::automatic : Engine::tables;
    seed % 2 == 0 ? expect_none_matters<float>(*plan, engine, 12, static_cast<unsigned>(seed))
                  : expect_none_matters<double>(*plan, engine, 12, static_cast<unsigned>(seed));
    ++moved;
  }
  EXPECT_GT(moved, 150);
}

}  // namespace
}  // namespace lockstep
