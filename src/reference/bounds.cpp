// Bounded rows of the reference, (M54) and (M56) to (M58). SPDX-License-Identifier: Apache-2.0
#include "bounds.h"

#include <algorithm>
#include <cmath>

#include "model/tendons.h"

namespace lockstep::reference {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool has_range(const Joint& joint) {
  return joint.kind != JointKind::ball && (joint.lower > -infinity || joint.upper < infinity);
}
// No angle passes pi.
bool has_angle_range(const Joint& joint) { return joint.kind == JointKind::ball && joint.upper < 3.14159; }
bool hard_range(const Joint& joint) { return has_range(joint) && is_hard(joint.limit_softness); }
bool hard_drive(const Joint& joint) { return joint.drive.kinematic && is_hard(joint.drive.softness); }

bool has_hard_row(const Joint& joint) {
  return hard_range(joint) || hard_drive(joint) || joint.velocity_limit < infinity || joint.friction > 0.0;
}

bool is_bounded(const Joint& joint) {
  return joint.moves() && (has_hard_row(joint) || has_range(joint) || has_angle_range(joint) || joint.drive.kinematic ||
                           joint.effort_limit < infinity);
}

// (M56): the speed that goes to an end of the range in h, or beyond the end a share of the way back. `beyond` is the
// sign of the distance beyond the end.
double end_speed(double distance, double beyond, double share, double h) {
  return (distance * beyond > 0.0 ? share : 1.0) * distance / h;
}

// Makes the rows of each kind at one moment of a step.
class Maker {
 public:
  Maker(const Mechanism& mechanism, const Stage& stage, const Inputs& inputs, const Moment& moment)
      : mechanism_(mechanism), stage_(stage), inputs_(inputs), moment_(moment), h_(stage.h / moment.substeps) {
    MatrixXd with_armature = stage.mass;
    with_armature.diagonal() += mechanism.armature();
    const MatrixXd inverse = with_armature.llt().solve(MatrixXd::Identity(stage.mass.rows(), stage.mass.cols()));
    inertia_ = inverse.diagonal().tail(mechanism.dofs());
  }

  std::vector<BoundedRow> rows() const {
    std::vector<BoundedRow> rows;
    const int dofs = mechanism_.dofs();
    for (int dof = 0; dof < dofs; ++dof)
      if (has_hard_row(mechanism_.joint(dof))) rows.push_back(hard_row(dof));
    for (int dof = 0; dof < dofs; ++dof)
      if (has_angle_range(mechanism_.joint(dof))) rows.push_back(angle_range(dof));
    for (int dof = 0; dof < dofs; ++dof) {
      const Joint& joint = mechanism_.joint(dof);
      if (has_range(joint) && !hard_range(joint) && terms(joint.limit_softness, inertia_[dof]).active)
        rows.push_back(soft_range(dof));
    }
    for (int dof = 0; dof < dofs; ++dof) {
      const Joint& joint = mechanism_.joint(dof);
      if (joint.drive.kinematic && !hard_drive(joint) && terms(joint.drive.softness, inertia_[dof]).active)
        rows.push_back(soft_drive(dof));
    }
    for (int c = 0; c < stage_.couplings.count(); ++c)
      if (stage_.rows[c].active && stage_.rows[c].limited) rows.push_back(limited_coupling(c));
    return rows;
  }

 private:
  Row terms(const Softness& softness, double r) const { return substep_row(softness, r, stage_.h, moment_.substeps); }

  BoundedRow along(int dof) const {
    BoundedRow row;
    row.direction = VectorXd::Unit(mechanism_.velocities(), mechanism_.root_velocities() + dof);
    row.dof = dof;
    return row;
  }

  BoundedRow hard_row(int dof) const {
    const Joint& joint = mechanism_.joint(dof);
    const double speed = stage_.state.v[mechanism_.root_velocities() + dof], q = moment_.q[dof];
    const bool velocity_phase = moment_.phase == Phase::velocity;
    BoundedRow row = along(dof);
    if (hard_range(joint)) {
      const double share = velocity_phase ? 0.0 : terms(joint.limit_softness, inertia_[dof]).erp;
      row.lo = end_speed(joint.lower - q, 1.0, share, h_);
      row.hi = end_speed(joint.upper - q, -1.0, share, h_);
      const double e = joint.restitution;
      if (velocity_phase && e > 0.0) {  // (M57)
        const double lo = row.lo, hi = row.hi;
        if (speed < lo) row.lo = std::max(lo, -e * speed);
        if (speed > hi) row.hi = std::min(hi, -e * speed);
      }
    }
    row.lo = std::clamp(row.lo, -joint.velocity_limit, joint.velocity_limit);
    row.hi = std::clamp(row.hi, -joint.velocity_limit, joint.velocity_limit);
    if (row.lo > row.hi) row.lo = row.hi = 0.5 * (row.lo + row.hi);  // as in (M59)
    if (hard_drive(joint)) {                                         // (M58)
      // Of the whole step, also in sub-steps.
      const double speed_target = inputs_.velocity_targets[dof];
      const double error = inputs_.position_targets[dof] - stage_.h * speed_target - stage_.state.q[dof];
      const double k = speed_target + erp_of(joint.drive.softness) * error / stage_.h;
      row.lo = row.hi = std::clamp(k, row.lo, row.hi);
    }
    row.box = (moment_.elapsed + h_) * joint.friction;  // one impulse for all sub-steps so far
    return row;
  }

  // The length of a ball's rotation vector grows by the velocity along it.
  BoundedRow angle_range(int dof) const {
    const Joint& joint = mechanism_.joint(dof);
    const Eigen::Vector3d vector = stage_.state.q.segment<3>(dof), way = moment_.q.segment<3>(dof) - vector;
    const Eigen::Vector3d along = vector.norm() > 0.0 ? vector.normalized().eval() : Eigen::Vector3d::UnitX().eval();
    const Row softness = terms(joint.limit_softness, 0.0);
    const bool velocity_phase = moment_.phase == Phase::velocity, hard = is_hard(joint.limit_softness);
    BoundedRow row;
    row.direction = VectorXd::Zero(mechanism_.velocities());
    row.direction.segment<3>(mechanism_.root_velocities() + dof) = along;
    row.dof = dof;
    const Eigen::Vector3d w = stage_.state.v.segment<3>(mechanism_.root_velocities() + dof);
    const Eigen::Vector3d across = stage_.h * (w - along.dot(w) * along);
    // The turns are about axes at right angles.
    const double angle =
        2.0 * std::acos(std::cos(0.5 * vector.norm()) * std::cos(0.5 * across.norm())) + along.dot(way);
    row.hi = end_speed(joint.upper - angle, -1.0, hard && velocity_phase ? 0.0 : softness.erp, h_);
    const double speed = row.direction.dot(stage_.state.v);
    if (hard && velocity_phase && joint.restitution > 0.0 && speed > row.hi)
      row.hi = std::min(row.hi, -joint.restitution * speed);
    row.cfm = softness.cfm;
    return row;
  }

  BoundedRow soft_range(int dof) const {
    const Joint& joint = mechanism_.joint(dof);
    const Row soft = terms(joint.limit_softness, inertia_[dof]);
    BoundedRow row = along(dof);
    row.lo = end_speed(joint.lower - moment_.q[dof], 1.0, soft.erp, h_);
    row.hi = end_speed(joint.upper - moment_.q[dof], -1.0, soft.erp, h_);
    row.cfm = soft.cfm;
    return row;
  }

  BoundedRow soft_drive(int dof) const {
    const Row soft = terms(mechanism_.joint(dof).drive.softness, inertia_[dof]);
    BoundedRow row = along(dof);
    row.box = infinity;
    row.bias = soft.erp / h_ * (moment_.q[dof] - target(dof)) - inputs_.velocity_targets[dof];
    row.cfm = soft.cfm;
    return row;
  }

  BoundedRow limited_coupling(int c) const {
    const Couplings& couplings = stage_.couplings;
    const Row soft = terms(couplings.softness[c], stage_.inertia[c]);
    BoundedRow row;
    row.direction = stage_.jacobian.row(c).transpose();
    row.coupling = c;
    row.box = h_ * couplings.force_limit[c];
    const bool unbiased = soft.hard && moment_.phase == Phase::velocity;  // (M33)
    row.bias = unbiased ? 0.0 : soft.erp / h_ * couplings.error(moment_.q)[c];
    row.cfm = soft.cfm;
    return row;
  }

  // A kinematic drive's position target at this moment. It moves with the velocity target and arrives at the end of the
  // step.
  double target(int dof) const {
    return inputs_.position_targets[dof] - (stage_.h - moment_.elapsed) * inputs_.velocity_targets[dof];
  }

  const Mechanism& mechanism_;
  const Stage& stage_;
  const Inputs& inputs_;
  const Moment& moment_;
  double h_;          // of the step or sub-step
  VectorXd inertia_;  // r of each joint alone
};

}  // namespace

std::vector<BoundedRow> bounded_rows(const Mechanism& mechanism, const Stage& stage, const Inputs& inputs,
                                     const Moment& moment) {
  return Maker(mechanism, stage, inputs, moment).rows();
}

Model without(const Ignored& ignored, Model model) {
  for (Joint& joint : model.joints) {
    const bool follows = joint.kind != JointKind::tendon &&
                         std::any_of(model.couplings.begin(), model.couplings.end(),
                                     [&](const Coupling& coupling) { return coupling.joint == joint.name; });
    const auto takes = [&](const JointSet& set) {
      return set.all || (set.followers && follows) ||
             std::find(set.names.begin(), set.names.end(), joint.name) != set.names.end();
    };
    if (takes(ignored.position_limits) && !has_slack_spring(joint)) joint.lower = -infinity, joint.upper = infinity;
    if (takes(ignored.velocity_limits)) joint.velocity_limit = infinity;
    if (takes(ignored.effort_limits)) joint.effort_limit = infinity;
    if (takes(ignored.friction)) joint.friction = 0.0;
  }
  return model;
}

bool has_bounds(const Model& model, const Ignored& ignored) {
  const Model remaining = without(ignored, model);
  return std::any_of(remaining.joints.begin(), remaining.joints.end(), is_bounded) ||
         std::any_of(remaining.couplings.begin(), remaining.couplings.end(),
                     [](const Coupling& coupling) { return coupling.force_limit < infinity; });
}

}  // namespace lockstep::reference
