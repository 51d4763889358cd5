// The part of a step that all methods of the reference share. SPDX-License-Identifier: Apache-2.0
#include "step.h"

#include "bounded.h"
#include "functions.h"
#include "lockstep/error.h"
#include "loop_step.h"

namespace lockstep::reference {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Stage::Stage(const Mechanism& mechanism, double step, const State& start, const Inputs& inputs)
    : h(step), state(start), couplings(mechanism, inputs.off, start.q) {
  const int dofs = mechanism.dofs(), nv = mechanism.velocities();
  mass = mechanism.mass_matrix(state);
  bias = mechanism.bias(state);
  bias += mechanism.inertial_axes_bias(mass, state.v);
  const VectorXd curving = curved_acceleration(mechanism, state);
  bias += mass * curving + mechanism.armature().cwiseProduct(curving);

  // Damping and drives are linear and implicit, at the end of the step:
  // A (v* - v) = h (tau - c - d v - kp (q + h v - q_t) - kd (v - v_t) - k (q + h v - rest)).
  const VectorXd &a = mechanism.armature(), &d = mechanism.damping(), &kp = mechanism.kp(), &kd = mechanism.kd();
  implicit = mass;
  implicit.diagonal() += a + h * (d + kd) + h * h * (kp + mechanism.stiffness());
  inverse = implicit.llt().solve(MatrixXd::Identity(nv, nv));
  State ahead = state;
  ahead.q += h * state.v.tail(dofs);
  const VectorXd forces = mechanism.joint_forces(ahead, inputs) + mechanism.wrench_forces(state, inputs.wrenches);
  free = state.v + h * inverse * (forces - bias);

  jacobian = couplings.velocity_jacobian();
  response = jacobian * inverse * jacobian.transpose();
  MatrixXd with_armature = mass;
  with_armature.diagonal() += a;
  inertia = inverse_inertias(couplings, with_armature);
  error = couplings.error(state.q);
  correction.resize(couplings.count());
  for (int i = 0; i < couplings.count(); ++i) {
    rows.push_back(row(couplings.softness[i], inertia[i], h));
    if (couplings.redundant[i] || couplings.off[i]) rows[i].active = false;
    rows[i].limited = couplings.force_limit[i] != infinity;
    correction[i] = rows[i].erp * error[i] / h;
  }
}

void visit(const Stage& stage, int i, double b, double cfm, double& impulse, VectorXd& v) {
  const double change = -(stage.jacobian.row(i).dot(v) + b + cfm * impulse) / (stage.response(i, i) + cfm);
  impulse += change;
  v += stage.inverse * stage.jacobian.row(i).transpose() * change;
}

void velocity_sweeps(const Stage& stage, int count, const std::vector<Row>& rows, const VectorXd& b, VectorXd& impulses,
                     VectorXd& v) {
  for (int sweep = 0; sweep < count; ++sweep)
    for (int i = 0; i < impulses.size(); ++i)
      if (rows[i].active) visit(stage, i, rows[i].hard ? 0.0 : b[i], rows[i].cfm, impulses[i], v);
}

Step finished(const Mechanism& mechanism, Stage stage, Solution solution) {
  State next = mechanism.advanced(stage.state, solution.position_velocity, stage.h);
  next.v = solution.velocity;
  mechanism.turn_axes(stage.state, next);
  next = placed(mechanism, std::move(next));
  return {std::move(next), std::move(solution.impulses), std::move(stage), std::move(solution.loop_impulses)};
}

Step step(const Mechanism& mechanism, const StepSettings& settings, const State& state, const Inputs& inputs) {
  const Model& model = mechanism.model();
  if (!model.loops.empty() && (settings.method == Method::pgs || settings.method == Method::tgs))
    throw SettingsError("method", "has no closed loops", "name direct or reduced");
  if (has_bounds(model, settings.ignore) || has_yielding_loops(model))
    return bounded_step(mechanism, settings, state, inputs);
  Stage stage(mechanism, settings.dt, state, inputs);
  Solution solution;
  if (!model.loops.empty()) {
    solution = with_loops(mechanism, stage, settings);
    return finished(mechanism, std::move(stage), std::move(solution));
  }
  switch (settings.method) {
    case Method::pgs: solution = pgs(stage, settings); break;
    case Method::tgs: solution = tgs(stage, settings); break;
    case Method::direct: solution = direct(stage, settings); break;
    case Method::reduced: solution = reduced(stage, settings); break;
    case Method::automatic:
      throw SettingsError("method", "is automatic", "name the method that the reference is to use");
  }
  return finished(mechanism, std::move(stage), std::move(solution));
}

}  // namespace lockstep::reference
