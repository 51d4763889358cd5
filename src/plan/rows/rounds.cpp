// The Newton rounds: their matrix, and which rows are slots of them. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

// Whether the joint follows one other by an entry of S.
bool has_one_leader(const Tables<double>& t, int follower) {
  const Reduction<double>& r = t.reduction;
  return r.eliminates() && r.start[follower + 1] - r.start[follower] == 1 && !is_spatial(t, r.follower[follower]);
}

// Where the joint's velocity comes from; velocity -1 if it is the sum of several.
LimitedServo servo_of(const Tables<double>& t, const Forms& forms, int joint) {
  const Reduction<double>& r = t.reduction;
  const int f = r.used() ? r.follower_of[joint] : -1;
  if (f < 0) return {forms.solver_of(t.velocity_of(joint)), -1, -1};
  return has_one_leader(t, f) ? LimitedServo{r.column[r.start[f]], r.start[f], f} : LimitedServo{-1, -1, -1};
}

}  // namespace

bool acts_on_one_velocity(const Tables<double>& t, int joint) {
  const int f = t.reduction.used() ? t.reduction.follower_of[joint] : -1;
  return f < 0 || has_one_leader(t, f);
}

namespace {

// A row of Bounds::rows, of Tables::rows or of a loop that is a slot, over the solver's velocities.
struct Slot {
  RowSlot row;
  std::vector<int> velocities;
};

std::vector<Slot> slots_of(const Tables<double>& t) {
  std::vector<Slot> slots;
  const auto add = [&](const Rows<double>& rows, int r, RowSlot slot) {
    slot.value = rows.term_start[r];
    slots.push_back({slot, {rows.term_index.data + rows.term_start[r], rows.term_index.data + rows.term_start[r + 1]}});
  };
  for (int e = 0; e < t.rows.count; ++e) add(t.rows, e, {-1, e, -1, 0, 0, 0, 0, Rank::coupling});
  const Bounds<double>& b = t.bounds;
  for (int r = b.single; r < b.rows.count; ++r) {
    const bool drives = b.kind[r] == BoundKind::drive || b.kind[r] == BoundKind::soft_drive;
    const Rank rank = b.kind[r] == BoundKind::coupling ? Rank::coupling : drives ? Rank::drive : Rank::limit;
    add(b.rows, r, {r, -1, -1, 0, 0, 0, 0, rank});
  }
  for (int l = 0; l < t.loops.loops.count; ++l) {
    const HeldLoop<double>& loop = t.loops.loops[l];
    std::vector<int> velocities;
    for (int k = loop.column; k < loop.column + loop.columns; ++k) velocities.push_back(t.loops.columns[k].velocity);
    for (int row = 0; row < loop.rows(); ++row)
      slots.push_back({{-1, -1, loop.row + row, 0, 0, loop.value + row * loop.columns, 0, Rank::loop}, velocities});
  }
  return slots;
}

// A_r, and what slots and contacts fill in.
Pattern pattern_of(const Tables<double>& t, std::vector<std::vector<int>> together) {
  Pattern pattern(t.solver.n);
  for (int z = 0; z < t.solver.n; ++z)
    if (t.solver.parent[z] >= 0) pattern.join(t.solver.parent[z], z);
  for (std::vector<int>& velocities : together) pattern.join_all(velocities);
  return pattern;
}

// By velocity of the solver, whether articulated bodies solve its tree.
std::vector<bool> of_bodies(const Tables<double>& t) {
  const std::vector<bool> trees = trees_with(t, InertiaKind::articulated_bodies);
  const std::vector<int> tree = trees_of_velocities(t);
  std::vector<bool> result;
  for (int z = 0; z < t.solver.n; ++z) result.push_back(trees[tree[t.reduction.velocity_of(z)]]);
  return result;
}

void lay_out_matrix(Program& program, const std::vector<std::vector<int>>& together) {
  Tables<double>& t = program.f64;
  Rounds& rounds = t.rounds;
  const int n = t.solver.n;
  const std::vector<bool> bodies = of_bodies(t);
  const Elimination tree = elimination_tree(pattern_of(t, together));
  require_room(program, entries_of(tree.parent), "the mass matrix beside its bounds and contacts");
  rounds.columns = make_columns(tree.parent, program.storage);
  rounds.renumbered = rounds.columns.entries != t.solver.entries || t.articulated.used();
  std::vector<int> place(static_cast<std::size_t>(n));
  for (int z = 0; z < n; ++z) place[static_cast<std::size_t>(tree.order[static_cast<std::size_t>(z)])] = z;
  std::vector<CopiedEntry> from_reduced, from_bodies;
  for (int j = 0; j < n && rounds.renumbered; ++j)
    for (int i = j; i < j + t.solver.size[j]; ++i) {
      const int to = entry_of(rounds.columns, place[static_cast<std::size_t>(i)], place[static_cast<std::size_t>(j)]);
      if (bodies[static_cast<std::size_t>(j)])
        from_bodies.push_back({entry_of(t.matrix, t.reduction.velocity_of(i), t.reduction.velocity_of(j)), to});
      else
        from_reduced.push_back({entry_of(t.solver, i, j), to});
    }
  t.makes_matrix = t.makes_matrix || !from_bodies.empty();
  rounds.place = program.storage.keep(std::move(place));
  rounds.from_reduced = program.storage.keep(std::move(from_reduced));
  rounds.from_bodies = program.storage.keep(std::move(from_bodies));
}

void lay_out_slots(Program& program, const std::vector<Slot>& slots) {
  Tables<double>& t = program.f64;
  Rounds& rounds = t.rounds;
  std::vector<RowSlot> rows;
  std::vector<int> term, entry;
  bool has_soft_loops = false;
  for (int l = 0; l < t.loops.loops.count; ++l)
    has_soft_loops = has_soft_loops || t.loops.loops[l].cfm_per_response > 0.0;
  for (const auto& [given, velocities] : slots) {
    RowSlot row = given;
    row.first = static_cast<int>(term.size()), row.entry = static_cast<int>(entry.size());
    for (const int z : velocities) {
      term.push_back(rounds.place[z]);
      for (int l = row.first; l < static_cast<int>(term.size()); ++l)
        entry.push_back(entry_of(rounds.columns, term.back(), term[static_cast<std::size_t>(l)]));
    }
    row.last = static_cast<int>(term.size());
    if (row.bounded >= 0 && t.bounds.kind[row.bounded] != BoundKind::servo)
      rounds.needs_responses = rounds.needs_responses || (t.bounds.rows.softness[row.bounded].cfm_per_response > 0.0 &&
                                                          t.bounds.undamped_row[row.bounded] < 0);
    rounds.needs_responses = rounds.needs_responses || (row.loop >= 0 && has_soft_loops);
    rows.push_back(row);
  }
  rounds.slots = program.storage.keep(std::move(rows));
  rounds.term = program.storage.keep(std::move(term));
  rounds.term_entry = program.storage.keep(std::move(entry));
}

// (M121), (M122): the joints whose linear terms a solve at the midpoint changes in the matrix.
void lay_out_implicit(Program& program) {
  Tables<double>& t = program.f64;
  const Reduction<double>& r = t.reduction;
  Rounds& rounds = t.rounds;
  std::vector<int> solver_of(static_cast<std::size_t>(t.velocities), -1);
  for (int z = 0; z < t.solver.n; ++z) solver_of[static_cast<std::size_t>(r.used() ? r.independent[z] : z)] = z;
  std::vector<ImplicitJoint> joints;
  std::vector<ImplicitTerm> terms;
  std::vector<int> entries;
  const bool may_differ = declared(program, Parameter::damping) || declared(program, Parameter::drive_gains) ||
                          declared(program, Parameter::stiffness);
  for (int j = 0; j < t.joints; ++j) {
    if (!may_differ && t.damping[j] == 0.0 && t.kp[j] == 0.0 && t.kd[j] == 0.0 && t.stiffness[j] == 0.0) continue;
    ImplicitJoint joint{j, static_cast<int>(terms.size()), 0, static_cast<int>(entries.size())};
    if (const int f = r.used() ? r.follower_of[j] : -1; f >= 0)
      for (int k = r.start[f]; k < r.start[f + 1]; ++k) terms.push_back({rounds.place[r.column[k]], k});
    else
      terms.push_back({rounds.place[solver_of[static_cast<std::size_t>(t.velocity_of(j))]], -1});
    joint.last = static_cast<int>(terms.size());
    for (int k = joint.first; k < joint.last; ++k)
      for (int l = joint.first; l <= k; ++l)
        entries.push_back(entry_of(rounds.columns, terms[static_cast<std::size_t>(k)].velocity,
                                   terms[static_cast<std::size_t>(l)].velocity));
    joints.push_back(joint);
  }
  rounds.implicit = program.storage.keep(std::move(joints));
  rounds.implicit_term = program.storage.keep(std::move(terms));
  rounds.implicit_entry = program.storage.keep(std::move(entries));
}

}  // namespace

void lay_out_rounds(Program& program) {
  Tables<double>& t = program.f64;
  Bounds<double>& b = t.bounds;

  // There are none for tgs, for pgs without contacts, for smooth integrators, where couplings lock everything, and
  // where nothing is bounded. Without contacts, bounds that euler cannot hold as single velocities take (M62).
  if (t.solver.n == 0) return;
  if (program.method == Method::tgs || (program.method == Method::pgs && program.contacts.pairs.empty())) return;
  const bool stages = program.integrator == Integrator::leapfrog;
  if (program.integrator != Integrator::euler && !stages) return;
  const bool limited = t.limited_servos.count + t.row_servos.count > 0;
  const bool held = t.loops.used();
  if (b.rows.count == 0 && !limited && !held && program.contacts.pairs.empty()) return;
  const std::optional<PlanObstacle> obstacle = obstacle_to_single_velocities(program);
  if (obstacle && program.contacts.pairs.empty() && !held && !stages) return;

  // Their matrix has A_r, and what slots and contacts fill in.
  std::vector<Slot> slots = slots_of(t);
  std::vector<std::vector<int>> together = contact_velocities(program);
  long entries = 0;
  for (const Slot& slot : slots) {
    together.push_back(slot.velocities);
    entries += pair_count(slot.velocities.size());
  }
  require_room(program, entries, the_response_matrix);
  lay_out_matrix(program, together);
  t.rows.known_suffice = t.rows.known_suffice && slots.empty();  // slots need the softness of their rows
  lay_out_slots(program, slots);

  // Bounds and limited servos of one velocity, which rounds hold there.
  Rounds& rounds = t.rounds;
  std::vector<int> velocity, row_of(static_cast<std::size_t>(t.solver.n), -1);
  for (int r = 0; r < b.single; ++r) {
    velocity.push_back(rounds.place[b.rows.term_index[b.rows.term_start[r]]]);
    row_of[static_cast<std::size_t>(velocity.back())] = r;
  }
  std::vector<LimitedServo> servos;
  const Forms forms(program, t.reduction);
  for (int i = 0; i < t.limited_servos.count; ++i) {
    servos.push_back(servo_of(t, forms, t.limited_servos[i]));
    servos.back().velocity = rounds.place[servos.back().velocity];
  }

  // In a leapfrog: whether its stages hold the bounds, and whether something is left for its midpoint.
  rounds.in_stages = stages && !obstacle;
  if (stages && obstacle && (b.rows.count > 0 || limited || held)) program.obstacles.push_back(*obstacle);
  rounds.at_midpoint = stages && (!rounds.in_stages || !program.contacts.pairs.empty());
  if (rounds.at_midpoint) lay_out_implicit(program);
  b.always |= (limited && !rounds.in_stages) || held;

  rounds.velocity = program.storage.keep(std::move(velocity));
  rounds.row_of = program.storage.keep(std::move(row_of));
  rounds.servos = program.storage.keep(std::move(servos));
  t.contacts.passes = program.settings.contacts.passes, t.contacts.rounds = program.settings.contacts.rounds;
  t.contacts.tolerance = program.settings.contacts.tolerance;
}

}  // namespace lockstep
