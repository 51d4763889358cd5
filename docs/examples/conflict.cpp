// Finding out why a joint stops short: a limit of a follower contradicts the motion that its leader is to make.
// SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cstdio>
#include <string>
#include <vector>

using namespace lockstep;

int main() {
  Model model = import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model;
  Joint& knuckle = model.joints[model.joint_index("knuckle")];
  knuckle.drive = {.position_target = 0.5, .kinematic = true};
  model.joints[model.joint_index("right_bar_joint")].upper = 0.3;  // the mistake: this follower must stop at 0.3 rad

  const Plan plan = compile(model, {.dt = 1.0 / 240, .record_diagnostics = true});
  Batch<double> batch(plan, 1);
  batch.step(240);
  std::printf("knuckle at %.3f rad, not %.3f\n", batch.positions()(plan.dof("knuckle"), 0), 0.5);

  // The rows that the last step could not meet, because they contradict each other.
  const std::vector<std::string> conflicts = batch.conflicts(0);
  for (const std::string& row : conflicts) std::printf("conflict: %s\n", row.c_str());

  // What each active row still lacks, in rad, and what it does: 1 holds (of limits: 1 the lower end, -1 the upper one),
  // 2 and -2 push with their largest force.
  const auto residuals = batch.row_residuals(), states = batch.row_states();
  for (Eigen::Index r = 0; r < states.rows(); ++r)
    if (states(r, 0) != 0.0)
      std::printf("%-30s residual %.3f, state %2.0f\n", plan.row_names()[r].c_str(), residuals(r, 0), states(r, 0));
}
