// SPDX-License-Identifier: Apache-2.0
#include "loads.h"

#include <fmt/format.h>

#include "jit/compile.h"
#include "scenes/scenes.h"

namespace lockstep::bench {

Engine engine_of(const Plan& plan, Engine wanted) {
  if (wanted != Engine::automatic) return wanted;
  const Program& program = program_of(plan);
  return !jit::speed_obstacle(program) && jit::plan_obstacle(program).empty() ? Engine::compiled : Engine::tables;
}

Load scene(const std::string& name, Method method, int iterations) {
  Load load;
  load.model = scenes::scene(name).model;
  load.settings.method = method;
  load.settings.integrator = Integrator::euler;
  load.settings.iterations = iterations;
  return load;
}

Load scene_with_ranges(const std::string& name, Method method) {
  Load load = scene(name, method, 1);
  for (Joint& joint : load.model.joints) joint.lower = -1e3, joint.upper = 1e3;
  return load;
}

Load chain(int joints, int couplings, Method method) {
  const Model eight = scenes::chain8();
  Load load;
  Model& model = load.model;
  model = eight;
  model.links.resize(1);
  model.joints.clear();
  model.couplings.clear();
  for (int i = 0; i < joints; ++i) {
    Joint joint = eight.joints[i == 0 ? 0 : 2 - i % 2];
    joint.name = fmt::format("j{}", i);
    joint.parent = model.links.back().name;
    joint.child = fmt::format("l{}", i);
    model.links.push_back({joint.child, eight.links[1].inertia});
    model.joints.push_back(joint);
  }
  for (int c = 0; c < couplings; ++c) {
    const int first = 4 * (c / 2) + c % 2;
    model.couplings.push_back(Coupling::mimic(fmt::format("j{}", first), fmt::format("j{}", first + 2), -1.0));
  }
  load.settings.method = method;
  load.settings.integrator = Integrator::euler;
  return load;
}

}  // namespace lockstep::bench
