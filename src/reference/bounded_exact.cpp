// direct and reduced with bounds: each phase is one convex minimum. SPDX-License-Identifier: Apache-2.0
#include "bounded.h"
#include "convex.h"
#include "followers.h"
#include "loop_step.h"

namespace lockstep::reference {

using Eigen::VectorXd;

constexpr double no_motion = 1e-9;  // of a loop's row that no velocity moves, such as those across a planar mechanism

// Couplings and loops are curves too: boxes, most of infinite size. All rows hold at once, so the elimination of
// followers changes one thing only: in reduced, friction acts on a follower's velocity without its correction w, (M59).
Exact exact_phase(const Bounded& step, Phase phase, const std::vector<Curve>& apart) {
  const Stage& stage = step.stage;
  Convex problem{stage.implicit, stage.implicit * stage.free, {}};
  std::vector<int> coupling;  // by curve; -1 if it is not a coupling's
  const auto add = [&](int c, Curve curve) {
    coupling.push_back(c);
    problem.curves.push_back(std::move(curve));
  };
  for (int c = 0; c < stage.couplings.count(); ++c) {
    const Row& row = stage.rows[c];
    if (!row.active || row.limited) continue;
    const double bias = row.hard && phase == Phase::velocity ? 0.0 : stage.correction[c];  // (M33)
    add(c, {stage.jacobian.row(c).transpose(), box_pieces(bias, infinity, row.cfm)});
  }
  VectorXd w = VectorXd::Zero(stage.free.size());
  if (step.settings.method == Method::reduced && phase == Phase::position)
    w = follower_corrections(step.mechanism, stage, step.settings);
  const Moment start_of_step{phase, stage.state.q};
  for (const BoundedRow& row : bounded_rows(step.mechanism, stage, step.inputs, start_of_step)) {
    if (row.lo > -infinity || row.hi < infinity) add(-1, {row.direction, interval_pieces(row.lo, row.hi, row.cfm)});
    const double bias = row.dof >= 0 && row.cfm == 0.0 ? -row.direction.dot(w) : row.bias;
    if (row.box > 0.0) add(row.coupling, {row.direction, box_pieces(bias, row.box, row.cfm)});
  }
  const LoopTargets loops = loop_targets(step.mechanism, stage, phase);
  std::vector<Eigen::Index> loop_curve(loops.bias.size(), -1);
  for (Eigen::Index i = 0; i < loops.bias.size(); ++i) {
    const VectorXd direction = loops.rows.jacobian.row(i).transpose();
    if (direction.norm() < no_motion) continue;
    loop_curve[i] = static_cast<Eigen::Index>(problem.curves.size());
    add(-1, {direction, box_pieces(loops.bias[i], loops.box[i], loops.cfm[i])});
  }
  for (const Curve& curve : apart) add(-1, curve);

  const Minimum found = minimum(problem);
  Exact result{found.v, VectorXd::Zero(stage.couplings.count()), VectorXd::Zero(loops.bias.size()),
               found.impulses.tail(apart.size())};
  for (std::size_t i = 0; i < coupling.size(); ++i)
    if (coupling[i] >= 0) result.impulses[coupling[i]] = found.impulses[i];
  for (std::size_t i = 0; i < loop_curve.size(); ++i)
    if (loop_curve[i] >= 0) result.loops[i] = found.impulses[loop_curve[i]];
  return result;
}

}  // namespace lockstep::reference
