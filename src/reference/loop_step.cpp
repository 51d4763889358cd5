// Euler steps with hard loops, as the nearest velocity that holds all rows. SPDX-License-Identifier: Apache-2.0
#include "loop_step.h"

#include <algorithm>

#include "functions.h"
#include "lockstep/error.h"
#include "nearest.h"

namespace lockstep::reference {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double fastest_closing = 3.0;  // m/s or rad/s, of each row
constexpr double slow_closing = 0.1;     // the same: what may stay in the velocity

struct Phases {
  const Mechanism& mechanism;
  const Stage& stage;
  std::vector<int> hard, soft;  // couplings that act

  Phases(const Mechanism& m, const Stage& s) : mechanism(m), stage(s) {
    for (int c = 0; c < stage.couplings.count(); ++c)
      if (stage.rows[c].active) (stage.rows[c].hard ? hard : soft).push_back(c);
  }

  // The velocity; impulses are those of the couplings and then those of the loops' rows.
  VectorXd solved(Phase phase, VectorXd& impulses) const {
    const LoopTargets loops = loop_targets(mechanism, stage, phase);
    const MatrixXd yielding = stage.jacobian(soft, Eigen::all);
    VectorXd stiffness(soft.size());
    for (std::size_t k = 0; k < soft.size(); ++k) stiffness[k] = 1.0 / stage.rows[soft[k]].cfm;
    const VectorXd soft_bias = stage.correction(soft);
    const MatrixXd a = stage.implicit + yielding.transpose() * stiffness.asDiagonal() * yielding;
    const VectorXd p = stage.implicit * stage.free - yielding.transpose() * stiffness.cwiseProduct(soft_bias);
    VectorXd speeds = -stage.correction(hard);
    if (phase == Phase::velocity) speeds.setZero();
    const Nearest found =
        nearest(a, p, {{stage.jacobian(hard, Eigen::all), speeds}, {loops.rows.jacobian, -loops.bias}});
    impulses = VectorXd::Zero(stage.couplings.count() + loops.bias.size());
    impulses(hard) = found.impulses.head(speeds.size());
    impulses(soft) = -stiffness.cwiseProduct(yielding * found.v + soft_bias);
    impulses.tail(loops.bias.size()) = found.impulses.tail(loops.bias.size());
    return found.v;
  }
};

}  // namespace

bool has_yielding_loops(const Model& model) {
  return std::any_of(model.loops.begin(), model.loops.end(), [](const Loop& loop) {
    return !is_hard(loop.softness) || loop.force_limit < infinity || loop.torque_limit < infinity;
  });
}

LoopTargets loop_targets(const Mechanism& mechanism, const Stage& stage, Phase phase) {
  LoopTargets targets{loop_rows(mechanism, stage.state), {}, {}, {}};
  const LoopRows& rows = targets.rows;
  const double h = stage.h;
  // Roots step with twists that are constant in inertial axes.
  targets.bias = h / 2.0 *
                 (rows.bias + mechanism.inertial_axes_bias(rows.jacobian, stage.state.v) +
                  rows.jacobian * curved_acceleration(mechanism, stage.state));
  targets.cfm = VectorXd::Zero(rows.error.size());
  targets.box = VectorXd::Constant(rows.error.size(), infinity);
  for (Eigen::Index i = 0; i < rows.error.size(); ++i) {
    const Loop& loop = mechanism.model().loops[rows.loop[i]];
    if (std::holds_alternative<Frequency>(loop.softness))
      throw SettingsError("softness", "is a frequency of a loop", "give kp and kd");
    const Row soft = row(loop.softness, 0.0, h);
    targets.cfm[i] = soft.cfm;
    targets.box[i] = h * (rows.turns[i] ? loop.torque_limit : loop.force_limit);
    const double closing = soft.erp * rows.error[i] / h;
    if (!soft.hard || std::abs(closing) <= slow_closing)
      targets.bias[i] += closing;
    else if (phase == Phase::position)
      targets.bias[i] += std::clamp(closing, -fastest_closing, fastest_closing);
  }
  return targets;
}

Solution with_loops(const Mechanism& mechanism, const Stage& stage, const StepSettings& settings) {
  const Phases phases(mechanism, stage);
  VectorXd impulses;
  Solution solution;
  solution.position_velocity = phases.solved(Phase::position, impulses);
  solution.velocity =
      settings.velocity_iterations > 0 ? phases.solved(Phase::velocity, impulses) : solution.position_velocity;
  const Eigen::Index couplings = stage.couplings.count();
  solution.impulses = impulses.head(couplings);
  solution.loop_impulses = impulses.tail(impulses.size() - couplings);
  return solution;
}

}  // namespace lockstep::reference
