// pgs and tgs with bounds: rows one after the other, by (M55). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>

#include "bounded.h"

namespace lockstep::reference {
namespace {

using Eigen::VectorXd;
using Rows = std::vector<BoundedRow>;

// (M55): the impulse of a row for the speed that it would have without it.
void visit_bounded(const Stage& stage, const BoundedRow& row, double& impulse, VectorXd& v) {
  const VectorXd response = stage.inverse * row.direction;
  const double yield = row.direction.dot(response) + row.cfm;
  const double speed = row.direction.dot(v) - row.direction.dot(response) * impulse;
  double next = row.box > 0.0 ? std::clamp(-(speed + row.bias) / yield, -row.box, row.box) : 0.0;
  const double then = speed + yield * next;
  if (then < row.lo) next = (row.lo - speed) / yield;
  if (then > row.hi) next = (row.hi - speed) / yield;
  v += response * (next - impulse);
  impulse = next;
}

// Impulses of one solve: of the couplings' rows, then of the bounded rows.
struct Impulses {
  Impulses(const Stage& stage, const Rows& rows)
      : couplings(VectorXd::Zero(stage.couplings.count())), bounded(VectorXd::Zero(rows.size())) {}
  VectorXd couplings, bounded;
};

// Those of the couplings with a force limit among the couplings' impulses.
VectorXd gathered(const Impulses& impulses, const Rows& rows) {
  VectorXd result = impulses.couplings;
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i].coupling >= 0) result[rows[i].coupling] = impulses.bounded[i];
  return result;
}

struct Coupled {  // the couplings' rows at one moment
  std::vector<Row> rows;
  VectorXd bias;
};

// Hard rows without their bias, (M33).
Coupled closing(Coupled coupled) {
  for (std::size_t i = 0; i < coupled.rows.size(); ++i)
    if (coupled.rows[i].hard) coupled.bias[i] = 0.0;
  return coupled;
}

using Touched = std::vector<bool>;  // the bounded rows that take part

void sweep(const Stage& stage, const Coupled& coupled, const Rows& rows, const Touched& touched, Impulses& impulses,
           VectorXd& v) {
  for (int i = 0; i < impulses.couplings.size(); ++i)
    if (coupled.rows[i].active && !coupled.rows[i].limited)
      visit(stage, i, coupled.bias[i], coupled.rows[i].cfm, impulses.couplings[i], v);
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (touched[i]) visit_bounded(stage, rows[i], impulses.bounded[i], v);
}

bool outside(const BoundedRow& row, const VectorXd& v) {
  const double u = row.direction.dot(v);
  return row.box > 0.0 || u < row.lo || u > row.hi;
}

// The solution with the rows that it takes: none at first, then those that the velocities of the phases come to
// violate, from the start each time.
Solution with_touched_rows(const Bounded& step, const std::function<Solution(const Touched&)>& solve) {
  const VectorXd& q = step.stage.state.q;
  const Rows opening = bounded_rows(step.mechanism, step.stage, step.inputs, {Phase::position, q});
  const Rows ending = bounded_rows(step.mechanism, step.stage, step.inputs, {Phase::velocity, q});
  Touched touched(opening.size(), false);
  for (;;) {
    Solution solution = solve(touched);
    bool more = false;
    for (std::size_t i = 0; i < touched.size(); ++i) {
      if (touched[i]) continue;
      touched[i] = outside(opening[i], solution.position_velocity) ||
                   (step.settings.velocity_iterations > 0 && outside(ending[i], solution.velocity));
      more = more || touched[i];
    }
    if (!more) return solution;
  }
}

}  // namespace

Solution bounded_pgs(const Bounded& step) {
  const Stage& stage = step.stage;
  const Coupled coupled{stage.rows, stage.correction};
  const Rows opening = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, stage.state.q});
  const Rows ending = bounded_rows(step.mechanism, stage, step.inputs, {Phase::velocity, stage.state.q});
  return with_touched_rows(step, [&](const Touched& touched) -> Solution {
    VectorXd v = stage.free;
    Impulses impulses(stage, opening);
    for (int k = 0; k < step.settings.iterations; ++k) sweep(stage, coupled, opening, touched, impulses, v);
    const VectorXd position_velocity = v;
    for (int k = 0; k < step.settings.velocity_iterations; ++k)
      sweep(stage, closing(coupled), ending, touched, impulses, v);
    return {position_velocity, v, gathered(impulses, opening)};
  });
}

// Sub-steps as those of tgs without bounds. Rows are renewed from the joints' moved positions. In the velocity
// iterations the impulses go on from the last sub-step's, so hard rows have its boxes, with the whole step's
// intervals; soft ones stay as they are.
Solution bounded_tgs(const Bounded& step) {
  const Stage& stage = step.stage;
  const int n = step.settings.iterations, count = stage.couplings.count();
  const double h = stage.h / n;
  Coupled coupled{stage.rows, VectorXd::Zero(count)};
  for (int i = 0; i < count; ++i)
    if (stage.rows[i].active && !stage.rows[i].limited)
      coupled.rows[i] = substep_row(stage.couplings.softness[i], stage.inertia[i], stage.h, n);

  return with_touched_rows(step, [&](const Touched& touched) -> Solution {
    VectorXd q = stage.state.q, v = stage.state.v;
    VectorXd velocity_sum = VectorXd::Zero(v.size()), impulse_sum = VectorXd::Zero(count);
    Rows rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, q, 0.0, n});
    Impulses impulses(stage, rows);
    for (int k = 0; k < n; ++k) {
      v += (stage.free - stage.state.v) / n;
      impulse_sum += gathered(impulses, rows);
      rows = bounded_rows(step.mechanism, stage, step.inputs, {Phase::position, q, k * h, n});
      Impulses next(stage, rows);  // joints' hard rows push one way only, and keep theirs to be able to take it back
      for (std::size_t i = 0; i < rows.size(); ++i)
        if (rows[i].dof >= 0 && rows[i].cfm == 0.0) next.bounded[i] = impulses.bounded[i];
      impulses = next;
      const VectorXd error = stage.couplings.error(q);
      for (int i = 0; i < count; ++i) coupled.bias[i] = coupled.rows[i].erp * error[i] / h;
      sweep(stage, coupled, rows, touched, impulses, v);
      q += h * v.tail(q.size());
      velocity_sum += v;
    }

    Rows ending = bounded_rows(step.mechanism, stage, step.inputs, {Phase::velocity, stage.state.q});
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (rows[i].cfm > 0.0) ending[i] = rows[i];
      ending[i].box = rows[i].box;
    }
    for (int k = 0; k < step.settings.velocity_iterations; ++k)
      sweep(stage, closing(coupled), ending, touched, impulses, v);
    return {velocity_sum / n, v, impulse_sum + gathered(impulses, rows)};
  });
}

}  // namespace lockstep::reference
