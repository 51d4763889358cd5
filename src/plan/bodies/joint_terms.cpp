// Damping, drives, armature, springs and limits of effort by joint. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"

namespace lockstep {

void lay_out_joint_terms(Program& program) {
  Tables<double>& t = program.f64;
  const double h = t.ahead;
  std::vector<double> armature(t.joints), damping(t.joints), kp(t.joints), kd(t.joints), implicit(t.joints);
  std::vector<double> stiffness(t.joints), rest(t.joints);
  std::vector<double> effort_limit(t.joints, unlimited);
  std::vector<int> linear_servos, limited, clamped, springs;
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const int i = program.solver_joint[j];
    if (i < 0) continue;
    const Joint& joint = program.model.joints[j];

    // Numbers of (M13), and what they add to the diagonal (M14).
    armature[i] = joint.armature;
    damping[i] = joint.damping;
    kp[i] = joint.drive.kp;
    kd[i] = joint.drive.kd;
    stiffness[i] = joint.stiffness;
    rest[i] = joint.rest;
    if (joint.stiffness > 0.0 || declared(program, Parameter::stiffness)) springs.push_back(i);
    implicit[i] = joint.armature + h * joint.damping + h * h * joint.stiffness;

    // Servos are linear, limited or both. An effort limit without a servo clamps the effort alone.
    const bool has_effort_limit = joint.effort_limit < infinity && !joint.drive.kinematic &&
                                  !leaves_out(program, program.settings.ignore.effort_limits, joint);
    const bool servo =
        !joint.drive.kinematic && (declared(program, Parameter::drive_gains) || kp[i] > 0.0 || kd[i] > 0.0);
    if (has_effort_limit) effort_limit[i] = std::min(joint.effort_limit, unlimited);
    // In a step of euler the kernels add the terms of a limited servo: each lane decides whether they apply.
    const bool limited_servo = servo && has_effort_limit,
               linear = servo && (!has_effort_limit || program.integrator != Integrator::euler);
    if (linear) implicit[i] += h * kd[i] + h * h * kp[i];
    if (linear) linear_servos.push_back(i);
    if (limited_servo) limited.push_back(i);
    if (has_effort_limit && !servo) clamped.push_back(i);
  }

  for (std::vector<int>* list : {&linear_servos, &limited, &clamped, &springs}) std::sort(list->begin(), list->end());
  t.armature = program.storage.keep(std::move(armature));
  t.damping = program.storage.keep(std::move(damping));
  t.kp = program.storage.keep(std::move(kp));
  t.kd = program.storage.keep(std::move(kd));
  t.stiffness = program.storage.keep(std::move(stiffness));
  t.rest = program.storage.keep(std::move(rest));
  t.springs = program.storage.keep(std::move(springs));
  t.implicit = program.storage.keep(std::move(implicit));
  t.servos = program.storage.keep(std::move(linear_servos));
  program.limited_servos = limited;
  t.limited_servos = program.storage.keep(std::move(limited));
  t.limited_efforts = program.storage.keep(std::move(clamped));
  t.effort_limit = program.storage.keep(std::move(effort_limit));
}

}  // namespace lockstep
