// What is written, in MuJoCo: it loads, weighs and moves as in lockstep. SPDX-License-Identifier: Apache-2.0
//
// Needs node, and LOCKSTEP_MUJOCO_JS, the folder that `npm install mujoco-js@0.0.7` (MuJoCo 3.3.8) has filled:
// .../node_modules/mujoco-js.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "export/export_helpers.h"
#include "lockstep/batch.h"
#include "lockstep/plan.h"
#include "model/trees.h"
#include "scenes/scenes.h"
#include "unit/import_helpers.h"

namespace lockstep {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::string;

class MujocoTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("LOCKSTEP_MUJOCO_JS");
    if (!folder || !fs::exists(folder)) GTEST_SKIP() << "LOCKSTEP_MUJOCO_JS names no folder";
    library = folder;
    work = fs::path(testing::TempDir()) / testing::UnitTest::GetInstance()->current_test_info()->name();
    fs::remove_all(work);
    fs::create_directories(work / "facts");
  }

  string run(const string& command) const {
    FILE* pipe = popen(command.c_str(), "r");
    string text;
    char piece[4096];
    while (const std::size_t count = std::fread(piece, 1, sizeof piece, pipe)) text.append(piece, count);
    EXPECT_EQ(pclose(pipe), 0) << command;
    return text;
  }

  string library;
  fs::path work;
};

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
      ImportOptions options{.least_mass = 1e-3, .least_inertia = 1e-7, .colliders = true};
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

// Without what only constraints do.
Model bare(Model model) {
  model.couplings.clear(), model.contacts.clear();
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
  const string complaints =
      run("node '" LOCKSTEP_MJCF "/facts.mjs' '" + library + "' '" + work.string() + "' '" + work.string() + "/facts'");
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

// The largest difference of a position, with steps of 0.1 ms on both sides; limits and friction are off.
double largest_difference(const Motion& motion, const fs::path& file, const std::function<string(string)>& run) {
  Model model = motion.model;
  for (Joint& joint : model.joints) {
    joint.lower = -infinity, joint.upper = joint.velocity_limit = joint.effort_limit = infinity;
    joint.friction = 0.0;
  }
  const double step = 1e-4;
  const Export made = export_mjcf_file(model, file, {.timestep = step});
  const Model order = import_mjcf(made.text).model;  // its links and joints are in MuJoCo's order
  const Trees trees(order);
  Batch<double> batch(compile(model, {.dt = step, .integrator = motion.integrator, .guard = infinity}), 1);
  const Plan& plan = batch.plan();
  std::istringstream rows(run(file.string() + "' " + std::to_string(motion.seconds)));
  double largest = 0.0;
  int count = 0;
  for (string line; std::getline(rows, line); ++count) {
    std::istringstream row(line);
    const auto compare = [&](double own) {
      double theirs = std::nan("");
      row >> theirs;
      largest = std::max(largest, std::isnan(theirs) ? infinity : std::abs(theirs - own));
    };
    for (std::size_t i = 0; i < order.links.size(); ++i) {
      const int joint = trees.parent_joint[i];
      const std::vector<string>& roots = plan.root_names();
      const auto root = std::find(roots.begin(), roots.end(), order.links[i].name) - roots.begin();
      if (joint < 0 && root < static_cast<std::ptrdiff_t>(roots.size())) {
        for (int k = 0; k < 3; ++k) compare(batch.root_poses()(7 * root + k, 0));
        Eigen::Vector4d own, theirs;
        for (int k = 0; k < 4; ++k) row >> theirs[k], own[k] = batch.root_poses()(7 * root + 3 + k, 0);
        largest = std::max(largest, std::min((own - theirs).norm(), (own + theirs).norm()));  // half the angle between
      } else if (joint >= 0 && order.joints[static_cast<std::size_t>(joint)].moves()) {
        compare(batch.positions()(plan.dof(order.joints[static_cast<std::size_t>(joint)].name), 0));
      }
    }
    batch.step(100);
  }
  EXPECT_EQ(count, static_cast<int>(std::round(motion.seconds / 0.01)) + 1);
  return largest;
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
    const double largest = largest_difference(motion, work / (motion.name + ".xml"), [&](const string& arguments) {
      return run("node '" LOCKSTEP_EXPORT "/motion.mjs' '" + library + "' '" + arguments);
    });
    EXPECT_LT(largest, motion.tolerance) << motion.name;
    std::printf("%s: %.2g\n", motion.name.c_str(), largest);
  }
}

}  // namespace
}  // namespace lockstep
