// A reset loop, as learning runs it: masses and gear ratios differ between environments, and environments that are
// finished or faulted start again while the others go on. SPDX-License-Identifier: Apache-2.0
#include <lockstep/lockstep.h>

#include <cstdio>
#include <limits>

using namespace lockstep;
using Row = Eigen::Array<float, 1, Eigen::Dynamic>;  // one number for each environment

int main() {
  constexpr int environments = 64, controls = 240, longest_episode = 60;
  constexpr float tolerance = 0.02f;  // rad

  Model model = import_urdf_file(LOCKSTEP_MODELS "/gripper.urdf").model;
  model.joints[model.joint_index("knuckle")].drive = {.kp = 20.0, .kd = 1.0};
  const Plan plan = compile(model, {.dt = 1.0 / 240, .per_environment = {Parameter::mass, Parameter::gear_ratio}});
  Batch<float> batch(plan, environments);
  const int knuckle = plan.dof("knuckle");

  // Forearms of 0.7 to 1.1 kg, and gear ratios that are up to 5 % off. Both hold until they are written again.
  batch.parameter(Parameter::mass).row(plan.link("forearm")) = Row::LinSpaced(environments, 0.7f, 1.1f);
  const Row factor = Row::LinSpaced(environments, 0.95f, 1.05f);
  for (int row = 0; row < plan.parameter_rows(Parameter::gear_ratio); ++row)
    batch.parameter(Parameter::gear_ratio).row(row) *= factor;

  // Targets beyond 0.73 rad, the limit of the joint, are never reached.
  batch.position_targets().row(knuckle) = Row::LinSpaced(environments, 0.1f, 0.9f);

  Eigen::ArrayXi age = Eigen::ArrayXi::Zero(environments);  // controls since the environment was reset
  Eigen::Array<bool, Eigen::Dynamic, 1> ended(environments);
  int reached = 0, late = 0, faulted = 0;
  for (int control = 0; control < controls; ++control) {
    // The controller of environment 5 computes a NaN, once.
    batch.efforts()(knuckle, 5) = control == 10 ? std::numeric_limits<float>::quiet_NaN() : 0.0f;
    batch.step(4);
    age += 1;

    const Row distance = (batch.positions().row(knuckle) - batch.position_targets().row(knuckle)).abs();
    for (int e = 0; e < environments; ++e) {
      const bool fault = batch.faults()[e] != Fault::none;
      const bool close = !fault && distance[e] < tolerance;
      const bool over = !fault && !close && age[e] == longest_episode;
      ended[e] = fault || close || over;
      faulted += fault, reached += close, late += over;
      if (ended[e]) age[e] = 0;
    }
    // Back to the state of the model, with the fault cleared. Parameters always stay; here the targets do, too.
    batch.reset(ended, {.keep_inputs = true});
  }
  std::printf("episodes: %d reached the target, %d took too long, %d faulted\n", reached, late, faulted);
  std::printf("environments with a fault now: %d\n", batch.faulted());
}
