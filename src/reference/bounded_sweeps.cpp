// pgs and tgs with bounds: sweeps over the rows, by (M55). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>

#include "bounded.h"

namespace lockstep::reference {
namespace {

using Eigen::VectorXd;
using Rows = std::vector<BoundedRow>;

// (M55): `speed` is the speed of the row without its impulse.
void visit_bounded(const Stage& stage, const BoundedRow& row, double& impulse, VectorXd& v) {
  const VectorXd response = stage.inverse * row.direction;
  const double softened_response = row.direction.dot(response) + row.cfm;
  const double speed = row.direction.dot(v) - row.direction.dot(response) * impulse;
  double next = row.box > 0.0 ? std::clamp(-(speed + row.bias) / softened_response, -row.box, row.box) : 0.0;
  const double boxed_speed = speed + softened_response * next;
  if (boxed_speed < row.lo) next = (row.lo - speed) / softened_response;
  if (boxed_speed > row.hi) next = (row.hi - speed) / softened_response;
  v += response * (next - impulse);
  impulse = next;
}

// Impulses of the couplings' rows and of the bounded rows in one solve.
struct Impulses {
  Impulses(const Stage& stage, const Rows& rows)
      : couplings(VectorXd::Zero(stage.couplings.count())), bounded(VectorXd::Zero(rows.size())) {}
  VectorXd couplings, bounded;
};

// Impulses of all couplings. Those with a force limit are bounded rows.
VectorXd gathered(const Impulses& impulses, const Rows& rows) {
  VectorXd result = impulses.couplings;
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i].coupling >= 0) result[rows[i].coupling] = impulses.bounded[i];
  return result;
}

struct CouplingRows {  // at one moment
  std::vector<Row> rows;
  VectorXd bias;
};

// The rows in the velocity phase: hard ones lose their bias, (M33).
CouplingRows in_velocity_phase(CouplingRows couplings) {
  for (std::size_t i = 0; i < couplings.rows.size(); ++i)
    if (couplings.rows[i].hard) couplings.bias[i] = 0.0;
  return couplings;
}

using Active = std::vector<bool>;  // by bounded row

void sweep(const Stage& stage, const CouplingRows& couplings, const Rows& rows, const Active& active,
           Impulses& impulses, VectorXd& v) {
  for (int i = 0; i < impulses.couplings.size(); ++i)
    if (couplings.rows[i].active && !couplings.rows[i].limited)
      visit(stage, i, couplings.bias[i], couplings.rows[i].cfm, impulses.couplings[i], v);
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (active[i]) visit_bounded(stage, rows[i], impulses.bounded[i], v);
}

bool outside(const BoundedRow& row, const VectorXd& v) {
  const double u = row.direction.dot(v);
  return row.box > 0.0 || u < row.lo || u > row.hi;
}

// The solution with the bounded rows that it needs. At first no row is active. Rows that the velocities of a phase
// violate become active, and the solve starts again from the beginning.
Solution solve_with_active_rows(const Bounded& step, const std::function<Solution(const Active&)>& solve) {
  const VectorXd& q = step.stage.state.q;
  const Rows position_rows = bounded_rows(step.mechanism, step.stage, step.inputs, {Phase::position, q});
  const Rows velocity_rows = bounded_rows(step.mechanism, step.stage, step.inputs, {Phase::velocity, q});
  Active active(position_rows.size(), false);
  for (;;) {
    Solution solution = solve(active);
    bool more = false;
    for (std::size_t i = 0; i < active.size(); ++i) {
      if (active[i]) continue;
      active[i] = outside(position_rows[i], solution.position_velocity) ||
                  (step.settings.velocity_iterations > 0 && outside(velocity_rows[i], solution.velocity));
      more = more || active[i];
    }
    if (!more) return solution;
  }
}

}  // namespace

Solution bounded_pgs(const Bounded& step) {
  const Stage& stage = step.stage;
  const CouplingRows couplings{stage.rows, stage.correction};
  const Rows position_rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, stage.state.q});
  const Rows velocity_rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::velocity, stage.state.q});
  return solve_with_active_rows(step, [&](const Active& active) -> Solution {
    VectorXd v = stage.free;
    Impulses impulses(stage, position_rows);
    for (int k = 0; k < step.settings.iterations; ++k) sweep(stage, couplings, position_rows, active, impulses, v);
    const VectorXd position_velocity = v;
    for (int k = 0; k < step.settings.velocity_iterations; ++k)
      sweep(stage, in_velocity_phase(couplings), velocity_rows, active, impulses, v);
    return {position_velocity, v, gathered(impulses, position_rows)};
  });
}

// Sub-steps as those of tgs without bounds; each makes the rows anew from the joints' moved positions. The velocity
// phase goes on with the impulses of the last sub-step. So its hard rows have the boxes of that sub-step and the
// intervals of the whole step, and its soft rows are those of that sub-step.
Solution bounded_tgs(const Bounded& step) {
  const Stage& stage = step.stage;
  const int n = step.settings.iterations, count = stage.couplings.count();
  const double h = stage.h / n;
  CouplingRows couplings{stage.rows, VectorXd::Zero(count)};
  for (int i = 0; i < count; ++i)
    if (stage.rows[i].active && !stage.rows[i].limited)
      couplings.rows[i] = substep_row(stage.couplings.softness[i], stage.inertia[i], stage.h, n);

  return solve_with_active_rows(step, [&](const Active& active) -> Solution {
    VectorXd q = stage.state.q, v = stage.state.v;
    VectorXd velocity_sum = VectorXd::Zero(v.size()), impulse_sum = VectorXd::Zero(count);
    Rows rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, q, 0.0, n});
    Impulses impulses(stage, rows);
    for (int k = 0; k < n; ++k) {
      v += (stage.free - stage.state.v) / n;
      impulse_sum += gathered(impulses, rows);
      rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, q, k * h, n});
      Impulses next(stage, rows);  // hard rows of joints push one way only: they keep their impulse to take it back
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (rows[i].dof >= 0 && rows[i].cfm == 0.0) next.bounded[i] = impulses.bounded[i];
      impulses = next;
      const VectorXd error = stage.couplings.error(q);
      for (int i = 0; i < count; ++i) couplings.bias[i] = couplings.rows[i].erp * error[i] / h;
      sweep(stage, couplings, rows, active, impulses, v);
      q += h * v.tail(q.size());
      velocity_sum += v;
    }

    Rows velocity_rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::velocity, stage.state.q});
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].cfm > 0.0) velocity_rows[i] = rows[i];
      velocity_rows[i].box = rows[i].box;
    }
    for (int k = 0; k < step.settings.velocity_iterations; ++k)
      sweep(stage, in_velocity_phase(couplings), velocity_rows, active, impulses, v);
    return {velocity_sum / n, v, impulse_sum + gathered(impulses, rows)};
  });
}

}  // namespace lockstep::reference
