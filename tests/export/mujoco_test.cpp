// What is written, in MuJoCo: it loads, weighs and moves as in lockstep. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "export/export_helpers.h"
#include "mjcf/mujoco.h"
#include "model/tendons.h"
#include "scenes/scenes.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::string;

using MujocoFacts = MujocoTest;
using MujocoMotion = MujocoTest;

// All that can be read, with what its bodies lack.
std::map<string, Model> models() {
  const char* variable = std::getenv("LOCKSTEP_TEST_DATA");
  const string data = variable ? variable : LOCKSTEP_TEST_DATA;
  std::map<string, Model> found;
  for (const fs::path& folder : {fs::path(LOCKSTEP_MODELS), fs::path(LOCKSTEP_MJCF) / "models", fs::path(data)}) {
    if (folder.empty()) continue;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
      const string path = entry.path().string();
      if (!path.ends_with(".urdf") && !path.ends_with(".xml")) continue;
      ImportOptions options{.least_mass = 1e-3, .least_inertia = 1e-7, .colliders = true, .leave_out_meshes = true};
      if (path.ends_with(".xml")) options.loops = Loops::leave_out;
      try {
        found[entry.path().stem().string()] = import_file(path, options).model;
      } catch (const Error&) {  // a part of another file, or a mechanism that lockstep lacks
      }
    }
  }
  for (const string& name : scenes::names()) found[name] = scenes::scene(name).model;
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    found["random" + std::to_string(seed)] = scenes::random_model(seed, scenes::forests());
  return found;
}

// Without what only constraints do. Tendons move their armature.
Model bare(Model model) {
  model.contacts.clear();
  std::erase_if(model.couplings, [&](const Coupling& coupling) { return !tendon_of(coupling, model); });
  for (Joint& joint : model.joints) joint.lower = -infinity, joint.upper = infinity;
  return model;
}

void expect_facts(const json& facts, const Model& model, double tolerance) {
  Batch<double> batch(compile(bare(model), {}), 1);
  const Plan& plan = batch.plan();
  double mass = 0.0;
  for (const Link& link : model.links) mass += link.inertia.mass;
  EXPECT_NEAR(facts["mass"].get<double>(), mass, 1e-6 * mass);
  EXPECT_NEAR(facts["energy"].get<double>(), batch.potential_energies()(0, 0),
              1e-6 * std::max(1.0, std::abs(batch.potential_energies()(0, 0))));
  batch.velocities().setZero();
  batch.root_velocities().setZero();
  const auto expect = [&](double& velocity, std::size_t dof, const string& name) {
    velocity = 1.0;
    const double wanted = facts["mass_matrix"][dof][dof];
    EXPECT_NEAR(2.0 * batch.kinetic_energies()(0, 0), wanted, tolerance * wanted) << name;
    velocity = 0.0;
  };
  const std::vector<string>& roots = plan.root_names();
  for (const json& joint : facts["joints"]) {
    const std::size_t dof = joint["dof"];
    if (joint["type"] != "free") {
      expect(batch.velocities()(plan.dof(joint["name"].get<string>()), 0), dof, joint["name"]);
      continue;
    }
    const auto root = std::find(roots.begin(), roots.end(), joint["body"].get<string>()) - roots.begin();
    for (int k = 0; k < 6; ++k)  // MuJoCo has the linear ones first; all directions of these weigh the same
      expect(batch.root_velocities()(6 * root + (k + 3) % 6, 0), dof + static_cast<std::size_t>(k), joint["body"]);
  }
}

TEST_F(MujocoFacts, are_those_of_the_models) {
  const std::map<string, Model> all = models();
  std::set<string> changed;
  for (const auto& [name, model] : all)
    if (warns(export_mjcf_file(model, work / (name + ".xml")), "inertias that MuJoCo refuses")) changed.insert(name);
  EXPECT_LT(changed.size(), all.size() / 4);
  fs::create_directories(work / "facts");
  const string complaints = run(LOCKSTEP_MJCF "/facts.mjs", {work, work / "facts"});
  EXPECT_EQ(complaints, "") << "MuJoCo refuses files";
  for (const auto& [name, model] : all) {
    SCOPED_TRACE(name);
    std::ifstream stream(work / "facts" / (name + ".json"));
    if (stream) expect_facts(json::parse(stream), model, changed.contains(name) ? 1e-4 : 1e-6);
  }
  std::printf("%zu models\n", all.size());
}

struct Motion {
  string name;
  Model model;
  Integrator integrator;
  double seconds, tolerance;  // rad or m
};

// Without limits and friction.
Model freed(Model model) {
  for (Joint& joint : model.joints) {
    joint.lower = -infinity, joint.upper = joint.velocity_limit = joint.effort_limit = infinity;
    joint.friction = 0.0;
  }
  return model;
}

TEST_F(MujocoMotion, is_that_of_the_models) {
  Model gripper = model_file("gripper").model;
  gripper.joints[static_cast<std::size_t>(gripper.joint_index("knuckle"))].drive = {
      .kp = 8.0, .kd = 0.3, .position_target = 0.4};
  std::vector<Motion> motions = {{"gripper", gripper, Integrator::leapfrog, 1.0, 1e-5}};
  motions.push_back(
      {"hand", import_mjcf_file(LOCKSTEP_MJCF "/models/hand.xml").model, Integrator::leapfrog, 0.3, 1e-5});
  // Floating trees with soft couplings, springs, servos and efforts. What differs is of second order in the step.
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    scenes::RandomOptions options = scenes::forests();
    options.soft = scenes::RandomOptions::Soft::always;
    Model model = scenes::random_model(seed, options);
    for (Coupling& coupling : model.couplings) coupling.softness = Spring{20.0, 0.5};
    motions.push_back({"random" + std::to_string(seed), model, Integrator::extrapolated, 0.1, 1e-6});
  }
  for (const Motion& motion : motions) {
    const Model model = freed(motion.model);
    const double step = 1e-4;  // on both sides
    const fs::path file = work / (motion.name + ".xml");
    export_mjcf_file(model, file, {.timestep = step});
    Batch<double> batch(compile(model, {.dt = step, .integrator = motion.integrator, .guard = infinity}), 1);
    const double largest =
        follow(batch, run(LOCKSTEP_EXPORT "/motion.mjs", {file, std::to_string(motion.seconds)})).difference;
    EXPECT_LT(largest, motion.tolerance) << motion.name;
    std::printf("%s: %.2g\n", motion.name.c_str(), largest);
  }
}

}  // namespace
}  // namespace lockstep
