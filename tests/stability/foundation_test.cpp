// Stiff, heavy and far-off mechanisms stay sound in single precision. SPDX-License-Identifier: Apache-2.0
//
// Every scene is passive: gravity, springs of drives that stand still, damping. So its energy, the drives' included,
// may grow only where couplings are corrected: from the start, by what lifting every link by its reach would take.
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "lockstep/plan.h"
#include "physics.h"
#include "scenes/scenes.h"

namespace lockstep {
namespace {

constexpr double seconds = 10.0, g = 9.81;

// One driver and 32 followers, all 1 rad off. The followers hang on `carrier`.
Model star(const std::string& carrier) {
  Model model;
  model.links = {{"base", {}}};
  physics::append_link(model, "base", {0, 0, 0}, Eigen::Vector3d::UnitY()).drive = {10.0, 1.0, 0.5, 0.0};
  for (int i = 0; i < 32; ++i) {
    Joint& joint = physics::append_link(model, carrier, {0.1, 0.05 * i, 0}, Eigen::Vector3d::Unit(i % 3), 0.05);
    joint.position = 1.0;
    joint.damping = 1e-3;
    model.couplings.push_back(Coupling::mimic(joint.name, "j0", i % 2 == 0 ? -1.0 : 0.5));
  }
  return model;
}

// A serial arm of 17 links whose every joint mimics the one before; all 16 couplings start 1 rad off.
Model serial() {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 17; ++i) {
    Joint& joint = physics::append_link(model, i == 0 ? "base" : model.links.back().name, {i == 0 ? 0.0 : 0.1, 0, 0},
                                        Eigen::Vector3d::UnitY());
    joint.position = i % 2 == 0 ? 0.5 : -0.5;
    joint.damping = 0.05;
    if (i > 0) model.couplings.push_back(Coupling::mimic(joint.name, model.joints[i - 1].name, -1.0));
  }
  return model;
}

// chain8 with q_A = ratio q_B, off by 1 rad.
Model geared(double ratio) {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) joint.position = 0.0;
  for (Coupling& coupling : model.couplings) {
    coupling.terms[0].ratio = -ratio;
    model.joints[static_cast<std::size_t>(model.joint_index(coupling.joint))].position = 1.0;
  }
  return model;
}

// chain8 with other masses and damping in proportion to them: what is asked is whether couplings and arithmetic bear
// the masses. Undamped heavy links ask how far an integrator of first order keeps energy, which is another question.
Model weighing(const std::function<double(int)>& mass) {
  Model model = scenes::chain8();
  for (int i = 0; i < 8; ++i) {
    model.links[i + 1].inertia = physics::link_box(mass(i));
    model.joints[i].damping *= mass(i) / 0.2;
    model.joints[i].position = i % 4 < 2 ? 0.8 : -0.2;  // 1 rad off
  }
  return model;
}

struct Scene {
  std::string name;
  Model model;
};
std::vector<Scene> all_scenes() {
  std::vector<Scene> all = {{"star", star("base")},
                            {"star_on_its_driver", star("l0")},
                            {"serial", serial()},
                            {"four_links_of_200_mg", weighing([](int i) { return i < 4 ? 0.2 : 2e-4; })},
                            {"200_kg_and_200_g", weighing([](int i) { return i % 2 == 0 ? 200.0 : 0.2; })}};
  for (double ratio : {0.001, 0.01, 1.0, 100.0, 1000.0})
    all.push_back({"gear ratio " + std::to_string(ratio), geared(ratio)});
  return all;
}

// With the energy of the drives' springs.
double energy(const Batch<float>& batch) {
  double sum = batch.kinetic_energies()(0, 0) + batch.potential_energies()(0, 0);
  const Model& model = batch.plan().model();
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const double stretch = batch.positions()(static_cast<Eigen::Index>(j), 0) - model.joints[j].drive.position_target;
    sum += 0.5 * model.joints[j].drive.kp * stretch * stretch;
  }
  return sum;
}

// From the lowest to the highest that every link can be: twice the length of the chain that carries it.
double budget(const Model& model) {
  double sum = 0.0;
  std::vector<double> reach(model.links.size(), 0.0);
  for (const Joint& joint : model.joints) {
    const auto child = static_cast<std::size_t>(model.link_index(joint.child));
    reach[child] = reach[static_cast<std::size_t>(model.link_index(joint.parent))] + joint.origin.translation().norm();
    const Inertia& inertia = model.links[child].inertia;
    sum += 2.0 * g * inertia.mass * (reach[child] + inertia.center.norm());
  }
  return sum;
}

TEST(Foundation, holds_in_float_from_starts_1_rad_off_the_couplings) {
  for (const Scene& scene : all_scenes())
    for (Method method : {Method::direct, Method::reduced})
      for (double dt : {1.0 / 240, 1.0 / 60}) {
        SCOPED_TRACE(scene.name + ", " + name(method) + ", dt " + std::to_string(dt));
        Batch<float> batch(compile(scene.model, physics::settings(method, 4, 1, dt)), 1, {.threads = 1});
        ASSERT_NEAR(batch.coupling_errors().abs().maxCoeff(), 1.0, 1e-6);
        const double most = energy(batch) + budget(scene.model);
        for (int i = 0; i < seconds / dt; ++i) {
          batch.step();
          ASSERT_EQ(batch.faulted(), 0) << "step " << i << ": " << name(batch.faults()[0]);
          ASSERT_LE(energy(batch), most) << "step " << i;
        }
        EXPECT_TRUE(batch.positions().isFinite().all() && batch.velocities().isFinite().all());
        EXPECT_LE(batch.coupling_errors().abs().maxCoeff(), 1e-5);
      }
}

// Angles of continuous joints are not wrapped, so that a coupling holds over any number of turns: as well as a float
// can say such an angle, a unit in the last place for each of the two.
TEST(Foundation, holds_a_coupling_of_continuous_joints_over_many_turns) {
  Model model;
  model.links = {{"base", {}}};
  for (int i = 0; i < 2; ++i) {
    Joint& joint = physics::append_link(model, "base", {0, 0.3 * i, 0}, Eigen::Vector3d::UnitZ());
    joint.kind = JointKind::continuous;
    joint.damping = 0.01;
  }
  model.joints[1].effort = 1.0;
  model.couplings = {Coupling::mimic("j0", "j1", -2.0)};
  for (Method method : {Method::direct, Method::reduced})
    for (double dt : {1.0 / 240, 1.0 / 60}) {
      Batch<float> batch(compile(model, physics::settings(method, 4, 1, dt)), 1, {.threads = 1});
      for (int i = 0; i < seconds / dt; ++i) {
        batch.step();
        const double a = batch.positions()(0, 0), last_place = std::numeric_limits<float>::epsilon() * std::abs(a);
        ASSERT_LE(batch.coupling_errors().abs()(0, 0), 1e-6 + 2.0 * last_place);
      }
      EXPECT_GT(batch.positions()(1, 0), 20.0 * 2.0 * M_PI);
      EXPECT_EQ(batch.faulted(), 0);
    }
}

}  // namespace
}  // namespace lockstep
