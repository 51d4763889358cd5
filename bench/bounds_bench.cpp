// What bounds that act cost: random targets over the joints' ranges, new every 8 steps. SPDX-License-Identifier:
// Apache-2.0
//
//   bounds_bench [robot.urdf ...]
//
// Prints a table: ns of CPU time an environment-step on one core, the least of interleaved repeats, and how many times
// that of the step without bounds and that of the tables this is. chain8 and the gripper of the tests come first.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <random>
#include <vector>

#include "lockstep/lockstep.h"
#include "scenes/scenes.h"

using namespace lockstep;

namespace {

constexpr int environments = 512, substeps = 8, repeats = 40;

struct Bounds {
  const char* name;
  Ignored ignored;
  bool friction;
};

const std::vector<Bounds> all_bounds = {
    {"none", {true, true, true, true}, false},           {"ranges, speeds", {false, false, true, true}, false},
    {"and efforts", {false, false, false, true}, false}, {"friction alone", {true, true, true, false}, true},
    {"all", {false, false, false, false}, true},
};

// A servo on each joint that follows none, which reaches its limit of effort.
Model with_servos(Model model) {
  for (Joint& joint : model.joints) {
    const bool follows = std::any_of(model.couplings.begin(), model.couplings.end(),
                                     [&](const Coupling& coupling) { return coupling.joint == joint.name; });
    if (!joint.moves() || follows) continue;
    const double range = joint.upper - joint.lower < infinity ? joint.upper - joint.lower : 3.0;
    if (!(range > 0.0)) continue;
    const double effort = joint.effort_limit > 0.0 && joint.effort_limit < infinity ? joint.effort_limit : 10.0;
    joint.drive.kp = 4.0 * effort / range, joint.drive.kd = 0.05 * joint.drive.kp;
  }
  return model;
}

Model bounded_chain() {
  Model model = scenes::chain8();
  for (Joint& joint : model.joints) {
    joint.lower = -0.35, joint.upper = 0.35, joint.position = 0.2;
    joint.velocity_limit = 3.0, joint.effort_limit = 1.0;
  }
  return model;
}

// A table row of each engine that takes the model with all bounds; all take turns.
void measure(const Model& given, Integrator integrator) {
  const Model model = with_servos(given);
  struct Row {
    Engine engine;
    std::vector<Batch<float>> batches;
    std::vector<std::vector<double>> spent;
  };
  std::vector<Row> rows;
  for (const Engine engine : {Engine::tables, Engine::compiled}) {
    Row row{engine, {}, std::vector<std::vector<double>>(all_bounds.size())};
    try {
      for (const Bounds& bounds : all_bounds) {
        Model own = model;
        for (Joint& joint : own.joints)
          if (bounds.friction && joint.moves()) joint.friction = 0.02 * std::min(joint.effort_limit, 10.0);
        row.batches.emplace_back(compile(own, {.integrator = integrator, .ignore = bounds.ignored}), environments,
                                 BatchOptions{.threads = 1, .engine = engine});
      }
      rows.push_back(std::move(row));
    } catch (const SettingsError& error) {
      fmt::print(stderr, "{}: {}\n", model.name, error.what());
    }
  }
  std::mt19937 random(1);
  for (int repeat = 0; repeat < repeats; ++repeat) {
    Batch<float>::Array targets = rows[0].batches[0].position_targets();
    for (Eigen::Index dof = 0; dof < targets.rows(); ++dof) {
      const Joint& joint = model.joints[model.joint_index(rows[0].batches[0].plan().dof_names()[dof])];
      const double lower = joint.lower > -infinity ? joint.lower : -1.5,
                   upper = joint.upper < infinity ? joint.upper : 1.5;
      for (Eigen::Index e = 0; e < targets.cols(); ++e)
        targets(dof, e) = static_cast<float>(lower + (upper - lower) * (random() / 4294967296.0));
    }
    for (std::size_t i = 0; i < all_bounds.size(); ++i)
      for (Row& row : rows) {
        row.batches[i].position_targets() = targets;
        const std::clock_t start = std::clock();
        row.batches[i].step(substeps);
        row.spent[i].push_back(1e9 / CLOCKS_PER_SEC * static_cast<double>(std::clock() - start) /
                               (environments * substeps));
      }
  }
  const auto least = [](const std::vector<double>& spent) { return *std::min_element(spent.begin(), spent.end()); };
  for (const Row& row : rows) {
    fmt::print("| {}, {}, {} |", model.name, to_string(integrator), to_string(row.engine));
    for (std::size_t i = 0; i < all_bounds.size(); ++i) {
      const double time = least(row.spent[i]), free = least(row.spent[0]), tables = least(rows[0].spent[i]);
      const int faulted = row.batches[i].faulted();
      fmt::print(" {:.0f} ({:.1f}, {:.2f}){} |", time, time / free, time / tables,
                 faulted > 0 ? fmt::format(", {} faults", faulted) : "");
    }
    fmt::print("\n");
  }
  std::fflush(stdout);
}

}  // namespace

int main(int count, char** arguments) {
  std::vector<Model> models = {bounded_chain(), import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model};
  const ImportOptions repaired = {.least_mass = 1e-3, .least_inertia = 1e-6};
  for (int i = 1; i < count; ++i) models.push_back(import_urdf_file(arguments[i], repaired).model);
  fmt::print("| |");
  for (const Bounds& bounds : all_bounds) fmt::print(" {} |", bounds.name);
  fmt::print("\n|---|");
  for (std::size_t i = 0; i < all_bounds.size(); ++i) fmt::print("---|");
  fmt::print("\n");
  for (const Model& model : models)
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog}) measure(model, integrator);
}
