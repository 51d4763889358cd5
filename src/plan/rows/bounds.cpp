// Limits, friction, kinematic drives and force limits as bounded rows (section 12). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <numeric>

#include "dependence.h"
#include "model/tendons.h"
#include "plan/layout.h"

namespace lockstep {

bool has_range_of(const Program& program, const Joint& joint) {
  return has_slack_spring(joint) || ((joint.lower > -infinity || joint.upper < infinity) &&
                                     !leaves_out(program, program.settings.ignore.position_limits, joint));
}

namespace {

struct Row {
  BoundKind kind;
  int coupling;
  std::vector<Member> members;
};

// The hard bounds of a joint as JointBound bits.
int hard_bounds(const Program& program, const Joint& joint) {
  const Ignored& ignore = program.settings.ignore;
  int has = 0;
  if (has_range_of(program, joint) && is_hard(joint.limit_softness) && joint.kind != JointKind::ball) has |= has_range;
  if (has & has_range && joint.restitution > 0.0) has |= has_restitution;
  if (joint.velocity_limit < infinity && !leaves_out(program, ignore.velocity_limits, joint)) has |= has_speed_limit;
  const bool may_have_friction = declared(program, Parameter::friction) && joint.kind != JointKind::tendon;
  if ((joint.friction > 0.0 || may_have_friction) && !leaves_out(program, ignore.friction, joint)) has |= has_friction;
  if (joint.drive.kinematic && is_hard(joint.drive.softness)) has |= has_kinematic_drive;
  return has;
}

Member member_of(const Tables<double>& t, int joint) {
  const Reduction<double>& r = t.reduction;
  const int follower = r.eliminates() ? r.follower_of[joint] : -1;
  const bool simple = follower >= 0 && r.start[follower + 1] - r.start[follower] == 1 && !is_spatial(t, joint);
  return {joint, follower, simple ? r.start[follower] : -1};
}

// The solver velocity that the form consists of, or -1 if it has several.
int velocity_of(const RowForm& form) { return form.terms.size() == 1 ? form.terms.begin()->first : -1; }
// The same of a joint's form. A spatial tendon may stand still while it moves, so it is no bound of that velocity.
int velocity_of(const Tables<double>& t, int joint, const RowForm& form) {
  return is_spatial(t, joint) ? -1 : velocity_of(form);
}

// The rate at which a hard row corrects its error in each of N sub-steps, so that together they correct `erp` (M36).
double hard_rate(const StepSettings& s, double erp) {
  return (1.0 - std::pow(1.0 - erp, 1.0 / s.iterations)) * s.iterations / s.dt;
}

}  // namespace

void lay_out_joint_bounds(Program& program) {
  Tables<double>& t = program.f64;
  Bounds<double>& b = t.bounds;
  const StepSettings& s = program.settings;
  const auto zeros = [&] { return std::vector<double>(t.joints, 0.0); };
  std::vector<int> has(t.joints, 0);
  std::vector<double> lower = zeros(), upper = zeros(), limit_rate = zeros(), restitution = zeros(), speed = zeros(),
                      friction = zeros(), drive_rate = zeros(), sub_step_rate = zeros();

  // By joint, for (M56) to (M58): ends, rates of correction, friction as an impulse.
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const int i = program.solver_joint[j];
    if (i < 0) continue;
    const Joint& joint = program.model.joints[j];
    has[i] = hard_bounds(program, joint);
    lower[i] = std::max(joint.lower, -unlimited);
    upper[i] = std::min(joint.upper, unlimited);
    if (has_range_of(program, joint) && is_hard(joint.limit_softness)) {
      const double erp = erp_of(joint.limit_softness);
      limit_rate[i] = erp / s.dt;
      if (program.method == Method::tgs) sub_step_rate[i] = hard_rate(s, erp);
    }
    restitution[i] = joint.restitution;
    speed[i] = std::min(joint.velocity_limit, unlimited);
    friction[i] = s.dt * joint.friction;
    if (has[i] & has_kinematic_drive) drive_rate[i] = erp_of(joint.drive.softness) / s.dt;
  }

  // By coupling.
  std::vector<double> force_limit;
  for (const Coupling& coupling : program.model.couplings)
    force_limit.push_back(std::min(coupling.force_limit, unlimited));

  TableStorage& storage = program.storage;
  b.has = storage.keep(std::move(has));
  b.lower = storage.keep(std::move(lower));
  b.upper = storage.keep(std::move(upper));
  b.limit_rate = storage.keep(std::move(limit_rate));
  b.restitution = storage.keep(std::move(restitution));
  b.speed_limit = storage.keep(std::move(speed));
  b.friction = storage.keep(std::move(friction));
  b.drive_rate = storage.keep(std::move(drive_rate));
  b.sub_step_rate = storage.keep(std::move(sub_step_rate));
  b.force_limit = storage.keep(std::move(force_limit));
}

namespace {

double value_of(const Tables<double>& t, const Contribution& share) {
  return (share.term < 0 ? 1.0 : t.term_value[share.term]) * (share.value < 0 ? 1.0 : t.reduction.value[share.value]);
}

// Whether the coupling is redundant beside the eliminated ones: its form is zero up to rounding.
bool follows_from_eliminated(const Program& program, const RowForm& form) {
  if (!program.f64.reduction.eliminates() || shares_differ(program)) return false;
  for (const auto& [index, shares] : form.terms) {
    double sum = 0.0, size = 0.0;
    for (const Contribution& share : shares) {
      sum += value_of(program.f64, share);
      size += std::abs(value_of(program.f64, share));
    }
    if (std::abs(sum) > 1e-9 * size) return false;
  }
  return true;
}

// Whether the directions of hard rows may be linearly dependent, including those of the couplings that are left to
// solve.
bool may_depend(const Program& program, const Forms& all, const std::vector<Row>& rows,
                const std::vector<RowForm>& forms) {
  const Tables<double>& t = program.f64;
  std::vector<std::map<int, double>> hard;
  const auto add = [&](const RowForm& form) {
    hard.emplace_back();
    for (const auto& [index, shares] : form.terms)
      for (const Contribution& share : shares) hard.back()[index] += value_of(t, share);
  };
  for (std::size_t r = 0; r < rows.size(); ++r)
    if (rows[r].kind == BoundKind::joint || is_hard(forms[r].softness)) add(forms[r]);
  if (hard.empty()) return false;
  // The direction of a ball's range turns with the ball, and that of a spatial tendon with its segments, into those of
  // other rows.
  for (const Row& row : rows) {
    const bool turns =
        row.kind == BoundKind::ball_range || (row.kind == BoundKind::joint && is_spatial(t, row.members[0].joint));
    if (turns && hard.size() > 1) return true;
  }
  for (int r = 0; r < t.rows.count; ++r)
    if (const int c = t.rows.coupling[r];
        is_hard(program.model.couplings[c].softness) || declared(program, Parameter::softness))
      add(all.of_coupling(c));
  return depend(hard, t.solver.n);
}

// Limited servos that follow several velocities are rows, where the plan has rounds for these.
void split_servos(Program& program, bool rounds) {
  Tables<double>& t = program.f64;
  std::vector<int> single, rows;
  for (const int joint : program.limited_servos)
    (!rounds || acts_on_one_velocity(t, joint) ? single : rows).push_back(joint);
  t.limited_servos = program.storage.keep(std::move(single));
  t.row_servos = program.storage.keep(std::move(rows));
}

// Whether some bound is a row over several velocities, or stands beside couplings that are rows.
bool rows_compete(const Program& program) {
  const Tables<double>& t = program.f64;
  if (t.rows.count > 0 || t.row_servos.count > 0 || has_loops(program)) return true;
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const Joint& joint = program.model.joints[j];
    const int i = program.solver_joint[j];
    if (i < 0) continue;
    const bool soft =
        (has_range_of(program, joint) && (!is_hard(joint.limit_softness) || joint.kind == JointKind::ball)) ||
        (joint.drive.kinematic && !is_hard(joint.drive.softness));
    if (soft || (t.bounds.has[i] != 0 && !acts_on_one_velocity(t, i))) return true;
  }
  for (int c = 0; c < t.couplings; ++c)
    if (program.model.couplings[c].force_limit < infinity && !is_absent(program, c)) return true;
  return false;
}

bool is_single(const Tables<double>& t, const Row& row, const RowForm& form) {
  return row.kind == BoundKind::joint && velocity_of(t, row.members[0].joint, form) >= 0;
}

bool all_single(const Tables<double>& t, const std::vector<Row>& rows, const BoundForms& bounds) {
  for (std::size_t r = 0; r < rows.size(); ++r)
    if (!is_single(t, rows[r], bounds.forms[r])) return false;
  return true;
}

// Rows that bound one velocity come first, and their number becomes `single`.
void put_single_first(const Tables<double>& t, std::vector<Row>& rows, BoundForms& bounds, int& single) {
  std::vector<std::size_t> order(rows.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto end = std::stable_partition(order.begin(), order.end(),
                                         [&](std::size_t r) { return is_single(t, rows[r], bounds.forms[r]); });
  single = static_cast<int>(end - order.begin());
  std::vector<Row> sorted;
  BoundForms forms;
  for (const std::size_t r : order) {
    sorted.push_back(std::move(rows[r]));
    forms.forms.push_back(std::move(bounds.forms[r]));
    forms.joint.push_back(bounds.joint[r]);
  }
  rows = std::move(sorted), bounds = std::move(forms);
}

// Where the terms of their rows stand, which a step fills in.
void place_ball_ranges(Program& program, const Forms& forms, const std::vector<Row>& rows) {
  Tables<double>& t = program.f64;
  const Rows<double>& places = t.bounds.rows;
  std::vector<int> row_of(t.joints, -1);
  for (std::size_t r = 0; r < rows.size(); ++r)
    if (rows[r].kind == BoundKind::ball_range) row_of[rows[r].members[0].joint] = static_cast<int>(r);
  std::vector<BallJoint> balls(t.balls.data, t.balls.data + t.balls.count);
  for (BallJoint& ball : balls) {
    ball.row = row_of[ball.joint];
    for (int axis = 0; axis < 3 && ball.row >= 0; ++axis) {
      const RowForm form = forms.of_joint(ball.joint + axis);
      for (int k = places.term_start[ball.row]; k < places.term_start[ball.row + 1]; ++k)
        if (places.term_index[k] == velocity_of(form)) ball.value[axis] = k;
    }
  }
  t.balls = program.storage.keep(std::move(balls));
}

}  // namespace

BoundForms lay_out_bounds(Program& program) {
  Tables<double>& t = program.f64;
  Bounds<double>& b = t.bounds;
  const Model& model = program.model;
  lay_out_joint_bounds(program);

  std::vector<Row> rows;
  BoundForms result;
  const Forms forms(program, t.reduction);
  const auto add = [&](Row row, RowForm form) {
    // Couplings may leave no freedom that could be bounded. A servo pulls at them all the same.
    if (form.terms.empty() && row.kind != BoundKind::servo) return;
    result.joint.push_back(row.kind == BoundKind::coupling ? -1 : row.members[0].joint);
    rows.push_back(std::move(row));
    result.forms.push_back(std::move(form));
  };
  const auto each_joint = [&](auto&& act) {
    for (std::size_t j = 0; j < model.joints.size(); ++j)
      if (const int i = program.solver_joint[j]; i >= 0) act(model.joints[j], i);
  };

  // Rounds have rows over several velocities as slots. There are none where couplings lock everything.
  const bool rounds = t.solver.n > 0 && (!program.contacts.pairs.empty() || has_loops(program) ||
                                         program.integrator == Integrator::leapfrog);
  split_servos(program, rounds);
  const bool compete = rounds && rows_compete(program);

  // (M59): joints that move with one solver velocity share a row. Its form is that velocity itself. Beside rows over
  // several velocities, a kinematic drive is a row of its own, which gives way to the others (section 27).
  std::vector<int> row_of_velocity(t.solver.n, -1);
  each_joint([&](const Joint&, int i) {
    if ((compete ? b.has[i] & ~has_kinematic_drive : b.has[i]) == 0) return;
    RowForm form = forms.of_joint(i);
    const Member member = member_of(t, i);
    const int z = velocity_of(t, i, form);
    if (z >= 0 && row_of_velocity[z] >= 0) return rows[row_of_velocity[z]].members.push_back(member);
    if (z >= 0) {
      row_of_velocity[z] = static_cast<int>(rows.size());
      form.terms[z] = {{-1, -1}};
    }
    add({BoundKind::joint, -1, {member}}, std::move(form));
  });

  // All other rows stand for one joint or one coupling each.
  const auto add_soft = [&](BoundKind kind, const Softness& softness, int i) {
    RowForm form = forms.of_joint(i);
    form.softness = softness;
    Member member = member_of(t, i);
    member.share = -1;
    add({kind, -1, {member}}, std::move(form));
  };
  each_joint([&](const Joint& joint, int i) {
    if (joint.kind != JointKind::ball || !has_range_of(program, joint)) return;
    RowForm form = forms.of_joint(i);
    for (int k = 1; k < 3; ++k) forms.add_joint(i + k, -1, form);
    form.softness = joint.limit_softness;
    add({BoundKind::ball_range, -1, {member_of(t, i)}}, std::move(form));
  });
  each_joint([&](const Joint& joint, int i) {
    if (joint.kind == JointKind::ball) return;
    if (has_range_of(program, joint) && !is_hard(joint.limit_softness) && !is_absent(joint.limit_softness))
      add_soft(BoundKind::soft_limit, joint.limit_softness, i);
  });
  each_joint([&](const Joint& joint, int i) {
    if (joint.drive.kinematic && !is_hard(joint.drive.softness) && !is_absent(joint.drive.softness))
      add_soft(BoundKind::soft_drive, joint.drive.softness, i);
  });
  each_joint([&](const Joint&, int i) {
    if (compete && (b.has[i] & has_kinematic_drive)) add_soft(BoundKind::drive, Hard{}, i);
  });
  for (int i = 0; i < t.row_servos.count; ++i) add_soft(BoundKind::servo, Hard{}, t.row_servos[i]);
  for (int c = 0; c < t.couplings; ++c) {
    if (!(model.couplings[c].force_limit < infinity) || is_absent(program, c)) continue;
    RowForm form = forms.of_coupling(c);
    if (follows_from_eliminated(program, form)) form.terms.clear();
    add({BoundKind::coupling, c, {}}, std::move(form));
  }

  // As rows over the solver's velocities; those of one velocity first, if they may be held there (M83).
  b.single = 0;
  if (t.rows.count == 0 && (rounds || all_single(t, rows, result))) put_single_first(t, rows, result, b.single);
  b.rows = lay_out_forms(program, result.forms, t.solver, false);
  b.may_depend = may_depend(program, forms, rows, result.forms);
  place_ball_ranges(program, forms, rows);

  // When some row may be active: joints to look at in each step, or always. Joints that couplings lock have no row.
  std::vector<Watched> watched;
  each_joint([&](const Joint& joint, int i) {
    const bool has_speed = b.has[i] & has_speed_limit,
               ranged = has_range_of(program, joint) && joint.kind != JointKind::ball;
    b.always |= !rows.empty() && (b.has[i] & (has_friction | has_kinematic_drive)) != 0;
    if (has_speed || ranged) watched.push_back({i, (b.has[i] & has_restitution) != 0, ranged, has_speed});
  });
  for (const Row& row : rows) b.always |= row.kind != BoundKind::joint && row.kind != BoundKind::soft_limit;
  b.watched = program.storage.keep(std::move(watched));

  // By row: kinematic drives, softness, kinds and members.
  std::vector<BoundKind> kind;
  std::vector<int> member_start{0};
  std::vector<Member> members;
  std::vector<double> shares;
  std::vector<int> kinematic;
  for (const Row& row : rows) {
    bool drives = false;
    for (const Member& member : row.members) drives |= (b.has[member.joint] & has_kinematic_drive) != 0;
    kinematic.push_back(drives && (row.kind == BoundKind::drive || (row.kind == BoundKind::joint && !compete)));
  }
  b.kinematic = program.storage.keep(std::move(kinematic));
  program.bound_softness.clear();
  for (const RowForm& form : result.forms) program.bound_softness.push_back(form.softness);
  std::vector<double> soft_rate;
  for (std::size_t r = 0; r < rows.size(); ++r)
    soft_rate.push_back(row_softness(program, result.forms[r].softness, program.settings.dt, 1).rate);
  b.soft_rate = program.storage.keep(std::move(soft_rate));
  for (const Row& row : rows) {
    kind.push_back(row.kind);
    for (const Member& member : row.members) {
      members.push_back(member);
      shares.push_back(member.share < 0 ? 1.0 : t.reduction.value[member.share]);
    }
    member_start.push_back(static_cast<int>(members.size()));
  }
  b.kind = program.storage.keep(std::move(kind));
  b.member_start = program.storage.keep(std::move(member_start));
  b.member = program.storage.keep(std::move(members));
  b.member_share = program.storage.keep(std::move(shares));
  return result;
}

}  // namespace lockstep
