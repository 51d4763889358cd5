// Drives that are late, and motors whose effort limit falls with speed. SPDX-License-Identifier: Apache-2.0
#include "plan/layout.h"

namespace lockstep {

void lay_out_actuators(Program& program) {
  ActuatorTables<double>& a = program.f64.actuators;
  std::vector<DelayedDrive> delayed;
  std::vector<int> lagged, motors;
  std::vector<double> curve;
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const int i = program.solver_joint[j];
    if (i < 0) continue;
    const Joint& joint = program.model.joints[j];
    const Drive& drive = joint.drive;
    if (drive.delay > 0) {
      delayed.push_back({i, drive.delay});
      a.waiting += drive_inputs * drive.delay;
    }
    if (drive.lag > 0.0) lagged.push_back(i);
    if (drive.stall_effort == infinity || leaves_out(program, program.settings.ignore.effort_limits, joint)) continue;
    motors.push_back(i);
    curve.push_back(drive.stall_effort), curve.push_back(drive.no_load_speed);
  }
  a.delayed = program.storage.keep(std::move(delayed));
  a.lagged = program.storage.keep(std::move(lagged));
  a.motors = program.storage.keep(std::move(motors));
  a.curve = program.storage.keep(std::move(curve));
}

}  // namespace lockstep
