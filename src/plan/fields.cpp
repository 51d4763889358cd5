// SPDX-License-Identifier: Apache-2.0
#include "fields.h"

#include "model/functions.h"
#include "model/softness_numbers.h"

namespace lockstep {
namespace {

constexpr const char* axes[] = {"x", "y", "z"};

struct SoftnessNames {
  const char *first, *second;
};

SoftnessNames names_of(const Softness& softness) {
  switch (kind_of(softness)) {
    case SoftnessKind::hard:
    case SoftnessKind::erp_cfm: return {"erp", "cfm"};
    case SoftnessKind::spring: return {"kp", "kd"};
    case SoftnessKind::frequency: break;
  }
  return {"frequency", "damping ratio"};
}

Fields make_fields(const Program& program) {
  const Model& model = program.model;
  Fields fields;
  const auto add = [&](Parameter parameter, const std::string& name, double value) {
    fields.names[static_cast<unsigned>(parameter)].push_back(name);
    fields.values[static_cast<unsigned>(parameter)].push_back(value);
  };

  // By coupling, and by its terms.
  const std::vector<std::string> couplings = coupling_names(model);
  for (std::size_t c = 0; c < couplings.size(); ++c) {
    const Coupling& coupling = model.couplings[c];
    for (std::size_t k = 0; coupling.function && k < numbers_of(*coupling.function).size(); ++k)
      add(Parameter::function,
          couplings[c] + ": " + coupling.terms[0].joint + " " + number_names(*coupling.function)[k],
          numbers_of(*coupling.function)[k]);
    for (const CouplingTerm& term : coupling.terms)
      add(Parameter::gear_ratio, couplings[c] + ": " + term.joint, term.ratio);
    add(Parameter::offset, couplings[c], coupling.offset);
    add(Parameter::coupling_switch, couplings[c], 1.0);
    const SoftnessNumbers softness = numbers_of(coupling.softness);
    add(Parameter::softness, couplings[c] + " " + names_of(coupling.softness).first, softness.first);
    add(Parameter::softness, couplings[c] + " " + names_of(coupling.softness).second, softness.second);
  }

  // By joint that moves, so by dof.
  for (const Joint& joint : model.joints) {
    if (!joint.moves()) continue;
    add(Parameter::drive_gains, joint.name + " kp", joint.drive.kp);
    add(Parameter::drive_gains, joint.name + " kd", joint.drive.kd);
    add(Parameter::damping, joint.name, joint.damping);
    add(Parameter::armature, joint.name, joint.armature);
    add(Parameter::stiffness, joint.name, joint.stiffness);
    add(Parameter::friction, joint.name, joint.friction);
    add(Parameter::position_limits, joint.name + " lower", joint.lower);
    add(Parameter::position_limits, joint.name + " upper", joint.upper);
    add(Parameter::velocity_limit, joint.name, joint.velocity_limit);
    add(Parameter::effort_limit, joint.name, joint.effort_limit);
    add(Parameter::drive_delay, joint.name, joint.drive.delay);
    add(Parameter::drive_lag, joint.name, joint.drive.lag);
    add(Parameter::motor_curve, joint.name + " stall effort", joint.drive.stall_effort);
    add(Parameter::motor_curve, joint.name + " no-load speed", joint.drive.no_load_speed);
  }

  // By link; wrenches are 0.
  for (const Link& link : model.links) {
    add(Parameter::mass, link.name, link.inertia.mass);
    for (int k = 0; k < 3; ++k) add(Parameter::center_of_mass, link.name + " " + axes[k], link.inertia.center[k]);
    for (const char* kind : {" torque ", " force "})
      for (const char* axis : axes) add(Parameter::link_wrench, link.name + kind + axis, 0.0);
    for (int k = 0; k < 6; ++k)
      add(Parameter::inertia, link.name + " i" + axes[tensor_rows[k]] + axes[tensor_columns[k]],
          link.inertia.about_center(tensor_rows[k], tensor_columns[k]));
  }

  // By loop.
  for (const Loop& loop : model.loops) {
    add(Parameter::loop_switch, loop.name, 1.0);
    const Eigen::Vector3d place = loop.first_pose.translation();
    const Eigen::Quaterniond turn(loop.first_pose.linear());
    for (int k = 0; k < 3; ++k) add(Parameter::loop_frame, loop.name + " " + axes[k], place[k]);
    add(Parameter::loop_frame, loop.name + " qw", turn.w());
    for (int k = 0; k < 3; ++k) add(Parameter::loop_frame, loop.name + " q" + axes[k], turn.vec()[k]);
  }

  // By contact, and for the whole environment.
  for (const PlanContact& contact : program.plan_contacts)
    add(Parameter::contact_friction, contact.name, contact.friction);
  for (const PlanContact& contact : program.plan_contacts)
    add(Parameter::contact_restitution, contact.name, contact.restitution);
  for (const Collider& collider : model.colliders) {
    if (!program.f64.contacts.used()) break;  // then there are no such rows
    const Shape& shape = collider.shape;
    for (const char* number : {" x", " y", " z", " yaw"}) add(Parameter::collider_place, collider.name + number, 0.0);
    for (int k = 0; k < 3; ++k)
      add(Parameter::collider_size, collider.name + " " + axes[k], shape.kind == ShapeKind::hull ? 1.0 : shape.size[k]);
  }
  for (int k = 0; k < 3; ++k) add(Parameter::gravity, axes[k], model.gravity[k]);
  return fields;
}

}  // namespace

const Fields& fields_of(const Program& program) {
  return program.fields.get([&] { return std::make_shared<const Fields>(make_fields(program)); });
}

}  // namespace lockstep
