// The learning loop of learning.py in C++: actions, steps, observations, rewards, resets. SPDX-License-Identifier:
// Apache-2.0
//
//   learning_loop MODEL [environments] [euler|leapfrog]
//
// Prints million environment-steps a second on one core, p10 of 40 repeats of CPU time.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>

#include "lockstep/lockstep.h"

using namespace lockstep;

namespace {

constexpr int substeps = 8, repeats = 40, longest_episode = 100;

// As robot() of learning.py.
Model robot(const char* path) {
  Model model = import_urdf_file(path).model;
  for (Joint& joint : model.joints) {
    const bool follows = std::any_of(model.couplings.begin(), model.couplings.end(),
                                     [&](const Coupling& coupling) { return coupling.joint == joint.name; });
    if (!joint.moves() || follows) continue;
    if (!(joint.upper - joint.lower < infinity)) {
      if (joint.kind == JointKind::continuous) joint.kind = JointKind::revolute;
      joint.lower = -3.0, joint.upper = 3.0;
    }
    if (!(joint.upper > joint.lower)) continue;
    const double effort = joint.effort_limit > 0.0 && joint.effort_limit < infinity ? joint.effort_limit : 10.0;
    joint.drive.kp = 4.0 * effort / (joint.upper - joint.lower);
    joint.drive.kd = 0.05 * joint.drive.kp;
  }
  return model;
}

}  // namespace

int main(int count, char** arguments) {
  if (count < 2) return std::fprintf(stderr, "usage: learning_loop MODEL [environments] [euler|leapfrog]\n"), 2;
  const int n = count > 2 ? std::atoi(arguments[2]) : 4096;
  const bool leapfrog = count > 3 && std::string(arguments[3]) == "leapfrog";
  const Plan plan = compile(robot(arguments[1]), {.integrator = leapfrog ? Integrator::leapfrog : Integrator::euler,
                                                  .per_environment = {Parameter::mass, Parameter::gear_ratio}});
  Batch<float> batch(plan, n, {.threads = 1, .seed = 1});
  batch.reset_random();
  const int driven = static_cast<int>(plan.driven_dofs().size()), width = 2 * plan.dofs();
  const std::vector<Query> queries = {{Quantity::position}, {Quantity::velocity}};
  std::vector<float> actions(static_cast<std::size_t>(n * driven)), rewards(static_cast<std::size_t>(n)),
      seen(static_cast<std::size_t>(n * width));
  std::vector<std::uint8_t> ended(static_cast<std::size_t>(n));
  std::vector<double> seconds;
  for (int repeat = 0; repeat < repeats; ++repeat) {
    for (float& action : actions) action = 2.0f * static_cast<float>(std::rand()) / static_cast<float>(RAND_MAX) - 1.0f;
    const std::clock_t start = std::clock();
    batch.set_actions({actions.data(), 1, driven});
    batch.step(substeps);
    batch.read(queries, {seen.data(), 1, width});
    for (int e = 0; e < n; ++e) {
      const float* const own = seen.data() + static_cast<std::size_t>(e) * width;
      rewards[e] = 0.0f;
      for (int k = 0; k < 4; ++k) rewards[e] -= own[k] * own[k];
      ended[e] = batch.faults()[e] != Fault::none || (repeat + e) % longest_episode == 0;
    }
    batch.reset_random(ended);
    batch.read(queries, {seen.data(), 1, width});  // what the agent sees after the resets
    seconds.push_back(static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
  }
  std::sort(seconds.begin(), seconds.end());
  std::printf("%.2f\n", 1e-6 * n * substeps / seconds[repeats / 10]);
}
