// The couplings that a step solves, as rows over the solver's velocities. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "plan/layout.h"
#include "plan/limits.h"
#include "supports.h"

namespace lockstep {

RowSoftness<double> row_softness(const Program& program, const Softness& softness, double h, int substeps) {
  const double dt = program.settings.dt;
  const auto [first, second] = numbers_of(softness);
  RowSoftness<double> row{{kind_of(softness), false}, 0, 0, 0};
  const auto spring = [&](double kp, double kd) {
    row.rate = kp / (h * kp + kd);
    row.cfm = 1.0 / (h * (h * kp + kd));
  };
  switch (row.kind) {
    case SoftnessKind::hard:
    case SoftnessKind::erp_cfm:
      if (is_hard(softness))
        row.rate = (substeps == 1 ? first : 1.0 - std::pow(1.0 - first, 1.0 / substeps)) / h;
      else
        spring(first / (dt * dt * second), (1.0 - first) / (dt * second));
      break;
    case SoftnessKind::spring:
      if (first > 0.0 || second > 0.0) spring(first, second);
      break;
    case SoftnessKind::frequency:
      if (first > 0.0) {
        row.rate = first / (h * first + 2.0 * second);
        row.cfm_per_response = 1.0 / (h * first * (h * first + 2.0 * second));
      }
      break;
  }
  row.soft = row.cfm_per_response > 0.0 || row.cfm > smallest_compliance;
  return row;
}

namespace {

// Adds ascending velocities, each with the end of those that are in its subtree.
void add_support(const std::vector<int>& velocities, const Columns& columns, std::vector<SupportRange>& support) {
  for (int j : velocities) {
    const auto past = std::lower_bound(velocities.begin(), velocities.end(), j + columns.size[j]);
    support.push_back({j, *std::prev(past) + 1});
  }
}

// How many rows, from the r-th on, are worth computing side by side, and the velocities that they move. Side by side
// each velocity takes less time, but a row then also computes velocities that it does not move. Rows of different
// components stay apart: a row costs only its own trees.
std::pair<int, std::vector<int>> widest_group(const std::vector<Support>& supports, const std::vector<int>& component,
                                              int r) {
  std::vector<int> moved = supports[r].velocities;
  std::size_t separate = moved.size();
  int count = 1;
  for (; count < RowGroup::most && r + count < static_cast<int>(supports.size()); ++count) {
    const std::vector<int>& next = supports[r + count].velocities;
    if (component[r + count] != component[r]) break;
    std::vector<int> all = either(moved, next);
    if (all.size() * (count + 1) >= 2 * (separate + next.size())) break;
    moved = std::move(all);
    separate += next.size();
  }
  return {count, std::move(moved)};
}

// How K is factored: rows that share a root have an entry. Returns the order of the rows.
std::vector<int> order_rows(Program& program, const std::vector<Support>& supports, Rows<double>& rows) {
  Pattern pattern(static_cast<int>(supports.size()));
  RowsByRoot by_root = rows_by_root(supports);
  for (auto& [root, together] : by_root) pattern.join_all(together);
  const Elimination tree = elimination_tree(pattern);
  require_room(program, entries_of(tree.parent), the_response_matrix);
  rows.columns = make_columns(tree.parent, program.storage);
  return tree.order;
}

}  // namespace

Rows<double> lay_out_forms(Program& program, const std::vector<RowForm>& unordered, const Columns& columns,
                           bool factored) {
  const Tables<double>& t = program.f64;
  const int count = static_cast<int>(unordered.size());

  // Factored rows are numbered by their elimination tree. Swept rows keep the model's order.
  Rows<double> rows;
  std::vector<Support> moved_by = supports_of(program, unordered, columns);
  std::vector<int> order(count);
  for (int r = 0; r < count; ++r) order[r] = r;
  if (factored) order = order_rows(program, moved_by, rows);

  // By row: what its impulse moves, and its component.
  std::vector<Support> supports;
  std::vector<int> component;
  const std::vector<int> component_of = components(t);
  for (const int r : order) {
    supports.push_back(std::move(moved_by[r]));
    component.push_back(component_of[unordered[r].tree]);
  }

  // Row by row: terms and what they consist of, what the row moves, its softness.
  std::vector<int> coupling, term_start{0}, term_index, contribution_start{0}, support_start{0}, run_start{0};
  std::vector<double> term_value;
  std::vector<Contribution> contributions;
  std::vector<SupportRange> support;
  std::vector<SupportRun> runs;
  std::vector<RowSoftness<double>> softness;
  const bool tgs = program.method == Method::tgs;
  const int substeps = tgs ? program.settings.iterations : 1;
  for (int r = 0; r < count; ++r) {
    const RowForm& form = unordered[order[r]];
    coupling.push_back(form.coupling);
    for (const auto& [index, shares] : form.terms) {
      double value = 0.0;
      for (const Contribution& share : shares)
        value += (share.term < 0 ? 1.0 : t.term_value[share.term]) *
                 (share.value < 0 ? 1.0 : t.reduction.value[share.value]);
      term_index.push_back(index);
      term_value.push_back(value);
      contributions.insert(contributions.end(), shares.begin(), shares.end());
      contribution_start.push_back(static_cast<int>(contributions.size()));
    }
    term_start.push_back(static_cast<int>(term_index.size()));
    add_support(supports[r].velocities, columns, support);
    add_runs(supports[r].velocities, runs);
    run_start.push_back(static_cast<int>(runs.size()));
    support_start.push_back(static_cast<int>(support.size()));
    softness.push_back(row_softness(program, form.softness, program.length / substeps, substeps));
  }

  // Velocities that some row moves, and the others.
  std::vector<char> is_moved(columns.n, 0);
  for (const Support& own : supports)
    for (const int z : own.velocities) is_moved[z] = 1;
  std::vector<int> moved_by_some, unmoved;
  for (int z = 0; z < columns.n; ++z) (is_moved[z] ? moved_by_some : unmoved).push_back(z);
  const auto runs_of = [&](const std::vector<int>& numbers) {
    std::vector<SupportRun> all;
    add_runs(numbers, all);
    return program.storage.keep(std::move(all));
  };
  rows.moved = runs_of(moved_by_some), rows.unmoved = runs_of(unmoved);

  // Rows whose responses (M19) are computed side by side.
  std::vector<RowGroup> groups;
  std::vector<SupportRange> group_support;
  std::vector<SupportRun> group_runs;
  for (int r = 0; r < count;) {
    const auto [members, moved] = widest_group(supports, component, r);
    RowGroup group{r, members, false, static_cast<int>(group_support.size()), 0, static_cast<int>(group_runs.size()),
                   0};
    add_support(moved, columns, group_support);
    add_runs(moved, group_runs);
    group.support_last = static_cast<int>(group_support.size());
    group.run_last = static_cast<int>(group_runs.size());
    groups.push_back(group);
    r += members;
  }

  TableStorage& storage = program.storage;
  rows.count = count;
  rows.coupling = storage.keep(std::move(coupling));
  rows.term_start = storage.keep(std::move(term_start));
  rows.term_index = storage.keep(std::move(term_index));
  rows.term_value = storage.keep(std::move(term_value));
  rows.contribution_start = storage.keep(std::move(contribution_start));
  rows.contribution = storage.keep(std::move(contributions));
  rows.support_start = storage.keep(std::move(support_start));
  rows.support = storage.keep(std::move(support));
  rows.run_start = storage.keep(std::move(run_start));
  rows.runs = storage.keep(std::move(runs));
  rows.groups = storage.keep(std::move(groups));
  rows.group_support = storage.keep(std::move(group_support));
  rows.group_runs = storage.keep(std::move(group_runs));
  rows.softness = storage.keep(std::move(softness));
  lay_out_blocks(program, supports, factored, rows);
  return rows;
}

namespace {

// Whether the coupling is redundant in every environment. If gear ratios differ per environment, each lane finds out
// for itself. (If couplings are switched, none is always hard, so none is redundant.)
bool takes_no_impulse(const Program& program, int coupling) {
  return is_redundant(program, coupling) && !declared(program, Parameter::gear_ratio);
}

// By component, whether A differs from the undamped inertia, so that (24) needs a factorisation of its own.
std::vector<bool> matrix_holds_more(const Program& program, const std::vector<int>& component) {
  const Tables<double>& t = program.f64;
  const bool all = declared(program, Parameter::drive_gains) || declared(program, Parameter::damping) ||
                   declared(program, Parameter::stiffness);
  std::vector<bool> more(t.tree.count, all);
  const auto mark = [&](int j) { more[component[t.body[t.joint_body[j]].tree]] = true; };
  for (const int joint : program.limited_servos) mark(joint);
  for (int j = 0; j < t.joints; ++j)
    if (t.implicit[j] != t.armature[j]) mark(j);
  for (int f = 0; t.reduction.eliminates() && f < t.reduction.followers; ++f) mark(t.reduction.follower[f]);
  for (const int c : program.folded) mark(t.term_joint[t.term_start[c]]);
  return more;
}

// Adds rows whose softness is a natural frequency to `undamped`. Returns, by row, its place there, -1 for other rows.
std::vector<int> find_undamped(const Program& program, const std::vector<RowForm>& forms,
                               std::vector<RowForm>& undamped, const std::vector<int>& joint) {
  std::vector<int> place;
  const Forms over_all(program, {});
  const std::vector<int> component = components(program.f64);
  const std::vector<bool> more = matrix_holds_more(program, component);
  for (std::size_t r = 0; r < forms.size(); ++r) {
    const bool by_frequency = std::holds_alternative<Frequency>(forms[r].softness) && more[component[forms[r].tree]];
    place.push_back(by_frequency ? static_cast<int>(undamped.size()) : -1);
    if (!by_frequency) continue;
    RowForm form{forms[r].coupling, forms[r].softness};  // over all velocities
    if (form.coupling >= 0)
      form = over_all.of_coupling(form.coupling);
    else
      over_all.add_joint(joint[r], -1, form);
    undamped.push_back(std::move(form));
  }
  return place;
}

}  // namespace

void lay_out_rows(Program& program) {
  Tables<double>& t = program.f64;
  const bool factored = program.method == Method::direct || program.method == Method::reduced;

  // Couplings that are left to solve: neither absent, redundant, eliminated nor bounded.
  const Forms over_solver(program, t.reduction);
  std::vector<RowForm> forms;
  bool any_hard = false;
  for (int c = 0; c < t.couplings; ++c) {
    const Coupling& coupling = program.model.couplings[c];
    if (is_absent(program, c) || takes_no_impulse(program, c) || coupling.force_limit < infinity) continue;
    if (program.method == Method::reduced && always_hard(program, c)) continue;
    any_hard |= is_hard(coupling.softness) || declared(program, Parameter::softness);
    forms.push_back(over_solver.of_coupling(c));
  }

  // Rows of a component follow each other, so that they are grouped and numbered as they are without the others.
  const std::vector<int> component = components(t);
  std::stable_sort(forms.begin(), forms.end(),
                   [&](const RowForm& a, const RowForm& b) { return component[a.tree] < component[b.tree]; });
  std::vector<char> folds(t.couplings, 0);
  for (const int c : program.folded) folds[c] = 1;
  const auto folded =
      std::stable_partition(forms.begin(), forms.end(), [&](const RowForm& form) { return folds[form.coupling] == 0; });
  if (const long count = folded - forms.begin(); !factored) require_room(program, count * count, the_response_matrix);
  t.rows = lay_out_forms(program, {forms.begin(), folded}, t.solver, factored);
  t.folded = lay_out_forms(program, {folded, forms.end()}, t.solver, false);
  lay_out_folding(program);

  // Bounds, and rows whose frequency refers to the undamped inertia (M28).
  std::vector<RowForm> undamped, ordered;  // ordered: as the elimination tree numbers them
  for (int i = 0; i < t.impulse_coupling.count; ++i) ordered.push_back(over_solver.of_coupling(t.impulse_coupling[i]));
  t.undamped_row = program.storage.keep(find_undamped(program, ordered, undamped, {}));
  const BoundForms bounds = lay_out_bounds(program);
  t.bounds.undamped_row = program.storage.keep(find_undamped(program, bounds.forms, undamped, bounds.joint));
  t.undamped = lay_out_forms(program, undamped, t.matrix, false);

  // (M37), and whether the two phases (M33) have different solutions.
  const StepSettings& settings = program.settings;
  t.renewed = program.method == Method::tgs && settings.iterations > 1;
  t.free_share = t.renewed ? (settings.iterations + 1.0) / (2.0 * settings.iterations) : 1.0;
  const bool has_velocity_phase = settings.velocity_iterations > 0;
  const bool differs = factored ? any_hard || t.reduction.eliminates() : t.rows.count > 0;
  t.solve_twice = t.renewed || (has_velocity_phase && (differs || t.bounds.rows.count > 0 ||
                                                       !program.contacts.pairs.empty() || has_loops(program)));
  // Without rows both phases have the same solution.
  program.second_phase_anyway = t.renewed || !has_velocity_phase || differs || t.rows.count == 0;
}

}  // namespace lockstep
