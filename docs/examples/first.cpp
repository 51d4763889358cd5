// A gripper closes in 4096 environments. Run it in the root of the repository. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cstdio>
using namespace lockstep;

int main() {
  Model model = import_urdf_file("tests/models/gripper.urdf").model;  // or fill a Model in code
  model.joints[model.joint_index("knuckle")].drive = {.kp = 20.0, .kd = 1.0};
  Plan plan = compile(model, {.dt = 1.0 / 240});  // plan.describe() says what a step does
  const int knuckle = plan.dof("knuckle"), tip = plan.dof("left_tip_joint");
  Batch<float> batch(plan, 4096);
  batch.position_targets().row(knuckle) = 0.4f;                  // rad, in all environments
  for (int control = 0; control < 60; ++control) batch.step(4);  // one second
  std::printf("knuckle %.3f rad, left tip %.3f rad\n", batch.positions()(knuckle, 0), batch.positions()(tip, 0));
  std::printf("largest coupling error %g rad\n", batch.coupling_errors().abs().maxCoeff());
}
