// A program with the step of its model compiled into it. CMakeLists.txt beside this file adds the kernel.
// SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cstdio>

using namespace lockstep;

int main() {
  // The very plan that the OPTIONS in CMakeLists.txt state. A Batch finds the kernel by what the step does.
  Model model = import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model;
  model.joints[model.joint_index("knuckle")].drive = {.kp = 20.0, .kd = 1.0};
  const Plan plan = compile(model, {.dt = 1.0 / 240});

  Batch<float> batch(plan, 4096);
  std::printf("engine: %s, kernel: %s\n", to_string(batch.engine()), batch.kernel_name().c_str());
  if (batch.engine() != Engine::generated) {
    std::fputs(plan.describe().c_str(), stderr);  // says why not
    return 1;
  }
  batch.position_targets().row(plan.dof("knuckle")) = 0.4f;
  batch.step(240);
  std::printf("knuckle %.3f rad after one second\n", batch.positions()(plan.dof("knuckle"), 0));
}
