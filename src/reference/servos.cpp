// Servos at their limits of effort. SPDX-License-Identifier: Apache-2.0
#include "servos.h"

#include <algorithm>

namespace lockstep::reference {

using Eigen::VectorXd;

bool limited_servo(const Joint& joint) {
  const Drive& drive = joint.drive;
  return !drive.kinematic && joint.effort_limit < infinity && (drive.kp > 0.0 || drive.kd > 0.0);
}

Acting acting(const Mechanism& mechanism, const Inputs& inputs, const std::vector<Servo>& servos) {
  Model model = mechanism.model();
  Inputs changed = inputs;
  for (int dof = 0; dof < mechanism.dofs(); ++dof) {
    Joint& joint = model.joints[model.joint_index(mechanism.joint(dof).name)];
    const double limit = joint.effort_limit;
    if (limited_servo(joint)) {
      if (servos[dof] == Servo::linear) continue;
      joint.drive.kp = joint.drive.kd = 0.0;
      changed.efforts[dof] = servos[dof] == Servo::apart ? 0.0 : servos[dof] == Servo::high ? limit : -limit;
    } else if (!joint.drive.kinematic) {
      changed.efforts[dof] = std::clamp(changed.efforts[dof], -limit, limit);
    }
  }
  return {Mechanism(model), std::move(changed)};
}

Curve servo_curve(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage, int dof) {
  const Joint& joint = mechanism.joint(dof);
  const double h = stage.h, kp = joint.drive.kp, kd = joint.drive.kd;
  const double impulse_at_rest = h * (inputs.efforts[dof] - kp * (stage.state.q[dof] - inputs.position_targets[dof]) +
                                      kd * inputs.velocity_targets[dof]);
  const double slope = h * (h * kp + kd);
  return {VectorXd::Unit(mechanism.velocities(), mechanism.root_velocities() + dof),
          box_pieces(-impulse_at_rest / slope, h * joint.effort_limit, 1.0 / slope)};
}

std::vector<Servo> servos_at(const Mechanism& mechanism, const Inputs& inputs, const Stage& stage,
                             const VectorXd& velocity) {
  std::vector<Servo> servos(mechanism.dofs(), Servo::linear);
  for (int dof = 0; dof < mechanism.dofs(); ++dof) {
    const Joint& joint = mechanism.joint(dof);
    if (!limited_servo(joint)) continue;
    const double v = velocity[mechanism.root_velocities() + dof];
    const double effort = inputs.efforts[dof] - joint.drive.kd * (v - inputs.velocity_targets[dof]) -
                          joint.drive.kp * (stage.state.q[dof] + stage.h * v - inputs.position_targets[dof]);
    if (effort > joint.effort_limit) servos[dof] = Servo::high;
    if (effort < -joint.effort_limit) servos[dof] = Servo::low;
  }
  return servos;
}

}  // namespace lockstep::reference
