// Error against cost where bounds act, for euler and leapfrog. SPDX-License-Identifier: Apache-2.0
//
// Prints CSV: scene, integrator, steps a second, RMS error of the joints' positions over the motion against the
// event-driven reference (rad or m), and microseconds of CPU time for a second of one environment (256 in a batch,
// f64).
#include <fmt/format.h>

#include <cmath>
#include <ctime>

#include "lockstep/lockstep.h"
#include "reference/events.h"
#include "scenes/scenes.h"

using namespace lockstep;

namespace {

constexpr int samples = 30, environments = 256;
constexpr double seconds = 1.0;

// Bars that hang in a vertical plane.
Model arm(int bars) {
  Model model;
  model.links.push_back({"base", {}});
  for (int i = 0; i < bars; ++i) {
    model.links.push_back({fmt::format("bar{}", i), Inertia::box(1.0 - 0.3 * i, {0.4, 0.04, 0.04}, {0.2, 0.0, 0.0})});
    Joint joint;
    joint.name = fmt::format("j{}", i), joint.kind = JointKind::revolute, joint.axis = Eigen::Vector3d::UnitY();
    joint.parent = model.links[static_cast<std::size_t>(i)].name, joint.child = model.links.back().name;
    if (i > 0) joint.origin.translation() = Eigen::Vector3d(0.4, 0.0, 0.0);
    joint.damping = 0.02;
    model.joints.push_back(joint);
  }
  return model;
}

std::vector<Model> scenes_with_bounds() {
  std::vector<Model> all;
  const auto add = [&](const char* name, Model model) {
    model.name = name;
    all.push_back(std::move(model));
  };
  Model resting = arm(2);
  resting.joints[0].upper = resting.joints[0].position = 0.1, resting.joints[1].position = -0.6;
  add("arm that rests on a limit", resting);
  Model falling = arm(2);
  falling.joints[0].upper = 0.6, falling.joints[1].lower = -0.8, falling.joints[1].upper = 0.8;
  add("arm that falls onto limits", falling);
  Model ranges = scenes::chain8();
  for (Joint& joint : ranges.joints) joint.lower = -0.45, joint.upper = 0.45;
  add("chain8 with ranges", ranges);
  Model friction = scenes::chain8();
  for (Joint& joint : friction.joints) joint.friction = 0.02;
  add("chain8 with dry friction", friction);
  return all;
}

void measure(const Model& model, const reference::Motion& truth, Integrator integrator, int rate) {
  Batch<double> batch(compile(model, {.dt = 1.0 / rate, .integrator = integrator}), environments,
                      {.threads = 1, .engine = Engine::tables});
  const int steps = rate / samples;
  double squares = 0.0;
  const std::clock_t start = std::clock();
  for (int sample = 1; sample <= samples; ++sample) {
    batch.step(steps);
    for (int dof = 0; dof < batch.plan().dofs(); ++dof)
      squares += std::pow(batch.positions()(dof, 0) - truth.positions(sample, dof), 2);
  }
  const double spent = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  if (batch.faulted() > 0) return;
  fmt::print("{},{},{},{:.4e},{:.2f}\n", model.name, to_string(integrator), rate,
             std::sqrt(squares / (samples * batch.plan().dofs())), 1e6 * spent / environments / seconds);
}

}  // namespace

int main() {
  fmt::print("scene,integrator,rate,error,cost_us\n");
  for (const Model& model : scenes_with_bounds()) {
    const reference::Mechanism mechanism(model);
    const auto truth = reference::integrate_with_events(
        mechanism, mechanism.initial_state(), [](double, reference::Inputs&) {}, seconds / samples, samples, 240);
    for (const Integrator integrator : {Integrator::euler, Integrator::leapfrog})
      for (const int rate : {60, 120, 240, 480, 960, 1920}) measure(model, truth, integrator, rate);
    std::fflush(stdout);
  }
}
