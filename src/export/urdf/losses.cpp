// One line for each kind. SPDX-License-Identifier: Apache-2.0
#include "losses.h"

#include <fmt/format.h>

#include <cmath>

#include "model/softness_numbers.h"

namespace lockstep::exporter::urdf {

bool is_written(ShapeKind kind) { return !is_ground(kind) && kind != ShapeKind::ellipsoid && kind != ShapeKind::hull; }

void report_losses(const Model& model, Report& report) {
  if (model.gravity != Model().gravity)
    report.warn("gravity, left out",
                fmt::format("{:g} {:g} {:g}", model.gravity[0], model.gravity[1], model.gravity[2]));
  for (const NamedPose& pose : model.poses) report.warn("poses to start in, left out", pose.name);
  if (model.time_step > 0.0) report.warn("time step, left out", fmt::format("{:g} s", model.time_step));
  for (const Link& link : model.links)
    if (link.gravity != 1.0 && link.inertia.mass > 0.0) report.warn("shares of gravity, left out", link.name);
  for (const Root& root : model.roots)
    if (!root.velocity.isZero(0.0)) report.warn("velocities of roots, left out", root.link);
  for (const Collider& collider : model.colliders) {
    if (collider.link.empty())
      report.warn("colliders of the world, left out", collider.name);
    else if (!is_written(collider.shape.kind))
      report.warn("half-spaces, height fields, ellipsoids and hulls, left out", collider.name);
    else
      report.remark("colliders, without their friction and group", collider.name);
  }
  for (const Contact& contact : model.contacts) report.warn("contacts, left out", contact.first + "-" + contact.second);
}

void report_losses(const Loop& loop, Report& report) {
  report.remark("loops, as loop_joint of Isaac Sim, which most readers of URDF lack", loop.name);
  if (!is_hard(loop.softness))
    report.warn("softness of loops, left out", loop.name);
  else if (erp_of(loop.softness) != erp_of(Loop().softness))
    report.remark("shares of an error that a step corrects (erp), left out", loop.name);
  if (loop.force_limit < infinity || loop.torque_limit < infinity)
    report.warn("force limits of loops, left out", loop.name);
}

void report_losses(const Joint& joint, double start, Report& report) {
  const auto lose = [&](bool has, const char* what) {
    if (has) report.warn(what, joint.name);
  };
  const bool has_range = joint.lower > -infinity || joint.upper < infinity;
  const Drive& drive = joint.drive;
  lose(drive.kp > 0.0 || drive.kd > 0.0 || drive.kinematic || drive.delay > 0 || drive.lag > 0.0 ||
           drive.stall_effort < infinity,
       "drives, left out");
  lose(joint.effort != 0.0, "efforts, left out");
  lose(joint.armature > 0.0, "armatures, left out");
  lose(joint.stiffness > 0.0, "springs of joints, left out");
  lose(joint.effort_limit == 0.0, "effort limits of 0, which readers of URDF take for none");
  lose(has_range && !is_hard(joint.limit_softness), "softness of position limits, left out");
  lose(has_range && joint.restitution > 0.0, "restitution of position limits, left out");
  lose(joint.velocity != 0.0, "velocities of the start, left out");
  if (has_range && is_hard(joint.limit_softness) && erp_of(joint.limit_softness) != Hard().erp)
    report.remark("shares of an error that a step corrects (erp), left out", joint.name);
  if (std::abs(joint.position - start) > 1e-12) report.warn("positions of the start, left out", joint.name);
}

}  // namespace lockstep::exporter::urdf
