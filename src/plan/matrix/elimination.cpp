// The followers of always-hard couplings, eliminated: v = S z + w (M39). SPDX-License-Identifier: Apache-2.0
//
// Where J is constant, S is constant too. With gear ratios per environment, or functions, only its pattern is.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

// A row of [J, 1]: by joint, then by number of joints + row.
template <class E>
using SparseRow = std::map<int, E>;

template <class E>
E at(const SparseRow<E>& row, int column, E otherwise) {
  const auto entry = row.find(column);
  return entry == row.end() ? otherwise : entry->second;
}

// Rows, and which of them have an entry in a joint's column.
template <class E>
struct SparseRows {
  std::vector<SparseRow<E>> row;
  std::vector<std::set<int>> with;  // by joint

  SparseRows(std::size_t rows, int joints) : row(rows), with(static_cast<std::size_t>(joints)) {}
  void put(int r, int column, E entry) {
    row[static_cast<std::size_t>(r)][column] = entry;
    if (column < static_cast<int>(with.size())) with[static_cast<std::size_t>(column)].insert(r);
  }
};

struct HardRows {
  std::vector<int> coupling;              // by follower
  std::vector<int> pivot;                 // its follower joint
  std::vector<SparseRow<double>> matrix;  // after Gauss-Jordan elimination: only the pivot is left in a pivot column
};

HardRows gauss_jordan(const Program& program) {
  const Tables<double>& t = program.f64;
  HardRows rows;
  for (int c = 0; c < t.couplings; ++c)
    if (always_hard(program, c) && !is_redundant(program, c)) rows.coupling.push_back(c);
  const int count = static_cast<int>(rows.coupling.size());
  SparseRows<double> matrix(rows.coupling.size(), t.joints);
  for (int r = 0; r < count; ++r) {
    const int c = rows.coupling[r];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) matrix.put(r, t.term_joint[k], t.term_value[k]);
    matrix.put(r, t.joints + r, 1.0);
  }
  std::vector<char> is_pivot(t.joints, 0);
  long entries = 0;
  for (const SparseRow<double>& row : matrix.row) entries += static_cast<long>(row.size());
  for (int p = 0; p < count; ++p) {
    const SparseRow<double>& own = matrix.row[p];
    int pivot = 0;
    double largest = 0.0;
    for (auto entry = own.begin(); entry != own.lower_bound(t.joints); ++entry)
      if (std::abs(entry->second) > largest) pivot = entry->first, largest = std::abs(entry->second);
    const int first = t.term_joint[t.term_start[rows.coupling[p]]];
    if (places_tendon(t, rows.coupling[p]) || is_curved(program, rows.coupling[p]) ||
        (!is_pivot[first] && std::abs(at(own, first, 0.0)) * follower_preference >= largest))
      pivot = first;
    rows.pivot.push_back(pivot);
    is_pivot[pivot] = 1;
    require_room(program, entries, the_elimination);
    const double at_pivot = at(own, pivot, 0.0);
    for (const int r : matrix.with[pivot]) {
      if (r == p) continue;
      const auto left = matrix.row[r].find(pivot);
      const double times = left->second / at_pivot;
      matrix.row[r].erase(left), --entries;
      if (times == 0.0) continue;
      for (const auto& [column, number] : own) {
        if (column == pivot) continue;
        const auto [entry, is_new] = matrix.row[r].emplace(column, 0.0);
        entry->second -= times * number;
        entries += is_new ? 1 : 0;
        if (is_new && column < t.joints) matrix.with[column].insert(r);
      }
    }
    matrix.with[pivot] = {p};
  }
  require_room(program, entries, the_elimination);
  rows.matrix = std::move(matrix.row);
  for (SparseRow<double>& row : rows.matrix) std::erase_if(row, [](const auto& entry) { return entry.second == 0.0; });
  return rows;
}

// The same elimination on the pattern only, recorded as operations that each lane repeats with its own gear ratios.
// Returns the places of the final entries.
std::vector<SparseRow<int>> record_elimination(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  const int count = static_cast<int>(rows.coupling.size());
  SparseRows<int> matrix(rows.coupling.size(), t.joints);
  std::vector<Fill<double>> fills;
  std::vector<Reduction<double>::Elimination> eliminations;
  std::vector<Reduction<double>::Update> updates;
  std::vector<int> pivots;
  int entries = 0;
  const auto fill = [&](int r, int column, int term, double value) {
    require_room(program, entries, the_elimination);
    matrix.put(r, column, entries);
    fills.push_back({{entries, term}, value});
    return entries++;
  };

  // The entries of [J_h, 1] to begin with.
  for (int r = 0; r < count; ++r) {
    const int c = rows.coupling[r];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) fill(r, t.term_joint[k], k, t.term_value[k]);
    fill(r, t.joints + r, -1, 1.0);
  }

  // (M43), pivot by pivot. An entry that fills in begins as 0.
  for (int p = 0; p < count; ++p) {
    const int pivot = rows.pivot[p];
    const SparseRow<int>& own = matrix.row[p];
    const int at_pivot = at(own, pivot, -1);
    for (const int r : matrix.with[pivot]) {
      if (r == p) continue;
      const int first = static_cast<int>(updates.size());
      for (const auto& [column, source] : own) {
        if (column == pivot) continue;
        const int known = at(matrix.row[r], column, -1);
        updates.push_back({known < 0 ? fill(r, column, -1, 0.0) : known, source});
      }
      const auto left = matrix.row[r].find(pivot);
      eliminations.push_back({left->second, at_pivot, first, static_cast<int>(updates.size())});
      matrix.row[r].erase(left);
    }
    matrix.with[pivot] = {p};
  }

  for (int f = 0; f < count; ++f) pivots.push_back(at(matrix.row[f], rows.pivot[f], -1));
  reduction.entries = entries;
  reduction.fills = program.storage.keep(std::move(fills));
  reduction.eliminations = program.storage.keep(std::move(eliminations));
  reduction.updates = program.storage.keep(std::move(updates));
  reduction.pivot = program.storage.keep(std::move(pivots));
  return std::move(matrix.row);
}

// The couplings in an order in which each places its first joint by joints that are placed already: of those that can,
// always the first. Empty if they form a ring.
std::vector<int> placing_order(const Tables<double>& t, const std::vector<int>& couplings) {
  const auto first_joint = [&](int c) { return t.term_joint[t.term_start[c]]; };
  std::map<int, int> placers;                           // by joint: how many couplings are still to place it
  std::map<int, std::vector<std::size_t>> that_follow;  // by such a joint
  for (const int c : couplings) ++placers[first_joint(c)];
  std::vector<int> waiting(couplings.size(), 0), order;  // for how many of its joints
  std::set<std::size_t> ready;
  for (std::size_t i = 0; i < couplings.size(); ++i) {
    for (int k = t.term_start[couplings[i]] + 1; k < t.term_start[couplings[i] + 1]; ++k)
      if (placers.count(t.term_joint[k]) > 0) ++waiting[i], that_follow[t.term_joint[k]].push_back(i);
    if (waiting[i] == 0) ready.insert(i);
  }
  while (!ready.empty()) {
    const int c = couplings[*ready.begin()];
    ready.erase(ready.begin());
    order.push_back(c);
    if (--placers[first_joint(c)] > 0) continue;
    for (const std::size_t other : that_follow[first_joint(c)])
      if (--waiting[other] == 0) ready.insert(other);
  }
  return order.size() == couplings.size() ? order : std::vector<int>{};
}

// The couplings that place their followers, component by component. A component where a follower is not the first joint
// of its coupling, or where couplings form a ring, places none but its tendons, which come last.
void place(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  const std::vector<int> component = components(t);
  const auto component_of = [&](int joint) { return component[t.body[t.joint_body[joint]].tree]; };
  std::vector<std::vector<int>> couplings(t.tree.count);  // by component
  std::vector<bool> possible(t.tree.count, true);
  for (std::size_t p = 0; p < rows.pivot.size(); ++p) {
    const int c = rows.coupling[p], first = t.term_joint[t.term_start[c]];
    if (places_tendon(t, c) || is_curved(program, c)) continue;
    couplings[component_of(first)].push_back(c);
    if (rows.pivot[p] != first) possible[component_of(first)] = false;
  }
  std::vector<int> placing, placed;
  for (int i = 0; i < t.tree.count; ++i) {
    const std::vector<int> order = possible[i] ? placing_order(t, couplings[i]) : std::vector<int>{};
    possible[i] = !order.empty() || couplings[i].empty();
    placing.insert(placing.end(), order.begin(), order.end());
  }
  for (std::size_t p = 0; p < rows.pivot.size(); ++p) {
    if (places_tendon(t, rows.coupling[p])) placing.push_back(rows.coupling[p]);
    placed.push_back(possible[component_of(rows.pivot[p])]);  // a tendon moves as consistently as its joints do
  }
  placed.resize(static_cast<std::size_t>(t.reduction.followers), false);  // not spatial tendons
  t.reduction.all_placed = std::all_of(placed.begin(), placed.end(), [](int is_placed) { return is_placed; });
  t.reduction.placing = program.storage.keep(std::move(placing));
  t.reduction.placed = program.storage.keep(std::move(placed));
}

// Placed followers with their leaders. Empty unless each of them has one leader, which is independent.
std::vector<Pair> find_pairs(const Tables<double>& t) {
  const Reduction<double>& r = t.reduction;
  std::vector<Pair> pairs;
  for (int i = 0; i < r.placing.count; ++i) {
    const int c = r.placing[i], first = t.term_start[c], leader = first + 1;
    if (t.term_start[c + 1] != first + 2 || r.follower_of[t.term_joint[leader]] >= 0) return {};
    const int f = r.follower_of[t.term_joint[first]];
    pairs.push_back({t.term_joint[first], t.term_joint[leader], c, leader, r.start[f]});
  }
  return pairs;
}

// Prepares the shorter step of consistent followers (section 14). Diagnostics rule it out, as they report corrections.
void prepare_consistent_steps(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  Reduction<double>& r = t.reduction;
  r.placed = program.storage.keep(std::vector<int>(static_cast<std::size_t>(r.followers), 0));
  if (program.integrator != Integrator::euler) return;
  place(program, rows);
  r.consistent_is_shorter = r.placing.count > 0 && !program.settings.record_diagnostics && !t.shares_change();
  r.pairs = program.storage.keep(find_pairs(t));
  if (!r.consistent_is_shorter || shares_differ(program) || declared(program, Parameter::offset)) return;
  std::vector<Mirror> mirrors;
  for (int j = 0; j < t.joints; ++j) {
    const int f = r.follower_of[j], b = t.joint_body[j];
    if (f < 0 || !r.placed[f] || r.start[f + 1] != r.start[f] + 1) continue;
    const int leader = t.joint_body[r.leader[r.start[f]]];
    const double share = r.value[r.start[f]];
    bool shifted = false;
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) shifted |= t.offset[r.inverse_coupling[s]] != 0.0;
    if (t.body[b].prismatic || t.body[leader].prismatic || std::abs(share) != 1.0 || shifted) continue;
    mirrors.push_back({b, leader, share * t.body[b].sign * t.body[leader].sign < 0.0});
  }
  r.mirrors = program.storage.keep(std::move(mirrors));
}

}  // namespace

void eliminate_followers(Program& program) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  TableStorage& storage = program.storage;
  const bool differ = shares_differ(program);

  // [J_h, 1] after elimination: in numbers, and as operations where S differs.
  const HardRows rows = gauss_jordan(program);
  const int count = static_cast<int>(rows.coupling.size());
  if (count == 0 && !t.spatial.used()) return;
  std::vector<SparseRow<int>> entry;
  if (differ) entry = record_elimination(program, rows);

  // S, and the inverse of J's follower columns.
  std::vector<Follower> followers;
  std::vector<int> value_entry, inverse_start{0}, inverse_coupling, inverse_entry;
  std::vector<double> inverse_value;
  for (int f = 0; f < count; ++f) {
    const double pivot = at(rows.matrix[f], rows.pivot[f], 0.0);
    Follower follower{rows.pivot[f], {}};
    const auto add = [&](int column, double number, int place) {
      if (column == rows.pivot[f]) return;
      if (column < t.joints) {
        follower.shares.push_back({t.velocity_of(column), -number / pivot});
        if (differ) value_entry.push_back(place);
        return;
      }
      inverse_coupling.push_back(rows.coupling[column - t.joints]);
      inverse_value.push_back(number / pivot);
      if (differ) inverse_entry.push_back(place);
    };
    if (differ)
      for (const auto& [column, place] : entry[f]) add(column, at(rows.matrix[f], column, 0.0), place);
    else
      for (const auto& [column, number] : rows.matrix[f]) add(column, number, -1);
    followers.push_back(std::move(follower));
    inverse_start.push_back(static_cast<int>(inverse_coupling.size()));
  }
  for (Follower& tendon : spatial_followers(program, followers)) {
    followers.push_back(std::move(tendon));
    inverse_start.push_back(inverse_start.back());
  }
  lay_out_basis(program, followers, false);
  lay_out_spatial_columns(program);
  reduction.removes_by_force = program.integrator == Integrator::euler || program.integrator == Integrator::runge_kutta;

  // By velocity: the followers with which it shares entries of A, for products of A with corrections (M40).
  std::vector<std::vector<Momentum>> by_velocity(t.velocities);
  for (int f = 0; f < count; ++f) {
    const int own = t.velocity_of(rows.pivot[f]);
    const auto add = [&](int i) { by_velocity[i].push_back({entry_of(t.matrix, i, own), f}); };
    for (int i = t.matrix.parent[own]; i >= 0; i = t.matrix.parent[i]) add(i);
    for (int i = own; i < own + t.matrix.size[own]; ++i) add(i);
  }
  std::tie(reduction.momentum_start, reduction.momentum) = flattened(by_velocity, storage);

  // Rates of w (M39), and the eliminated dofs.
  std::vector<double> rate(t.couplings, 0.0);
  for (int c : rows.coupling) rate[c] = erp_of(program.model.couplings[c].softness) / program.length;
  program.eliminated.clear();
  for (const Follower& follower : followers) program.eliminated.push_back(t.dof[follower.joint]);

  reduction.inverse_start = storage.keep(std::move(inverse_start));
  reduction.inverse_coupling = storage.keep(std::move(inverse_coupling));
  reduction.inverse_value = storage.keep(std::move(inverse_value));
  reduction.rate = storage.keep(std::move(rate));
  reduction.value_entry = storage.keep(std::move(value_entry));
  reduction.inverse_entry = storage.keep(std::move(inverse_entry));
  find_exact_followers(program);
  prepare_consistent_steps(program, rows);
}

}  // namespace lockstep
