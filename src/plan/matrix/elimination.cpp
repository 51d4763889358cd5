// The followers of always-hard couplings, eliminated: v = S z + w (M39). SPDX-License-Identifier: Apache-2.0
//
// Where J is constant, S is constant too. With gear ratios per environment, or functions, only its pattern is.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "plan/layout.h"

namespace lockstep {
namespace {

struct HardRows {
  std::vector<int> coupling;  // by follower
  std::vector<int> pivot;     // its follower joint
  Eigen::MatrixXd matrix;     // [J, 1] after Gauss-Jordan elimination: only the pivot is left in a pivot column
};

bool is_pivot(const HardRows& rows, int joint) {
  return std::find(rows.pivot.begin(), rows.pivot.end(), joint) != rows.pivot.end();
}

HardRows gauss_jordan(const Program& program) {
  const Tables<double>& t = program.f64;
  HardRows rows;
  for (int c = 0; c < t.couplings; ++c)
    if (always_hard(program, c) && !is_redundant(program, c)) rows.coupling.push_back(c);
  const int count = static_cast<int>(rows.coupling.size());
  rows.matrix.setZero(count, t.joints + count);
  for (int r = 0; r < count; ++r) {
    const int c = rows.coupling[r];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) rows.matrix(r, t.term_joint[k]) = t.term_value[k];
    rows.matrix(r, t.joints + r) = 1.0;
  }
  for (int p = 0; p < count; ++p) {
    const Eigen::VectorXd row = rows.matrix.row(p).head(t.joints).cwiseAbs();
    int pivot = 0;
    const double largest = row.maxCoeff(&pivot);
    const int first = t.term_joint[t.term_start[rows.coupling[p]]];
    if (places_tendon(t, rows.coupling[p]) || is_curved(program, rows.coupling[p]) ||
        (!is_pivot(rows, first) && row[first] * follower_preference >= largest))
      pivot = first;
    rows.pivot.push_back(pivot);
    for (int r = 0; r < count; ++r) {
      if (r == p || rows.matrix(r, pivot) == 0.0) continue;
      rows.matrix.row(r) -= rows.matrix(r, pivot) / rows.matrix(p, pivot) * rows.matrix.row(p);
      rows.matrix(r, pivot) = 0.0;
    }
  }
  return rows;
}

// The same elimination on the pattern only, recorded as operations that each lane repeats with its own gear ratios.
// Returns the places of the final entries, -1 for structural zeros.
Eigen::MatrixXi record_elimination(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  const int count = static_cast<int>(rows.coupling.size());
  Eigen::MatrixXi entry = Eigen::MatrixXi::Constant(count, rows.matrix.cols(), -1);
  std::vector<Fill<double>> fills;
  std::vector<Reduction<double>::Elimination> eliminations;
  std::vector<Reduction<double>::Update> updates;
  std::vector<int> pivots;
  int entries = 0;
  const auto fill = [&](int r, int column, int term, double value) {
    entry(r, column) = entries;
    fills.push_back({{entries++, term}, value});
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
    for (int r = 0; r < count; ++r) {
      if (r == p || entry(r, pivot) < 0) continue;
      const int first = static_cast<int>(updates.size());
      for (int column = 0; column < entry.cols(); ++column) {
        if (column == pivot || entry(p, column) < 0) continue;
        if (entry(r, column) < 0) fill(r, column, -1, 0.0);
        updates.push_back({entry(r, column), entry(p, column)});
      }
      eliminations.push_back({entry(r, pivot), entry(p, pivot), first, static_cast<int>(updates.size())});
      entry(r, pivot) = -1;
    }
  }

  for (int f = 0; f < count; ++f) pivots.push_back(entry(f, rows.pivot[f]));
  reduction.entries = entries;
  reduction.fills = program.storage.keep(std::move(fills));
  reduction.eliminations = program.storage.keep(std::move(eliminations));
  reduction.updates = program.storage.keep(std::move(updates));
  reduction.pivot = program.storage.keep(std::move(pivots));
  return entry;
}

// The couplings of `remaining` in an order in which each places its first joint by joints that are placed already.
// Empty if they form a ring.
std::vector<int> placing_order(const Tables<double>& t, std::vector<int> remaining) {
  std::vector<int> order;
  const auto first_joint = [&](int c) { return t.term_joint[t.term_start[c]]; };
  const auto waits = [&](int c) {
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k)
      if (std::any_of(remaining.begin(), remaining.end(),
                      [&](int other) { return t.term_joint[k] == first_joint(other); }))
        return true;
    return false;
  };
  while (!remaining.empty()) {
    const auto next = std::find_if_not(remaining.begin(), remaining.end(), waits);
    if (next == remaining.end()) return {};
    order.push_back(*next);
    remaining.erase(next);
  }
  return order;
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
  Eigen::MatrixXi entry;
  if (differ) entry = record_elimination(program, rows);
  const auto present = [&](int f, int column) {
    return differ ? entry(f, column) >= 0 : rows.matrix(f, column) != 0.0;
  };

  // S, and the inverse of J's follower columns.
  std::vector<Follower> followers;
  std::vector<int> value_entry, inverse_start{0}, inverse_coupling, inverse_entry;
  std::vector<double> inverse_value;
  for (int f = 0; f < count; ++f) {
    const double pivot = rows.matrix(f, rows.pivot[f]);
    Follower follower{rows.pivot[f], {}};
    for (int j = 0; j < t.joints; ++j) {
      if (j == rows.pivot[f] || !present(f, j)) continue;
      follower.shares.push_back({t.velocity_of(j), -rows.matrix(f, j) / pivot});
      if (differ) value_entry.push_back(entry(f, j));
    }
    followers.push_back(std::move(follower));
    for (int r = 0; r < count; ++r) {
      if (!present(f, t.joints + r)) continue;
      inverse_coupling.push_back(rows.coupling[r]);
      inverse_value.push_back(rows.matrix(f, t.joints + r) / pivot);
      if (differ) inverse_entry.push_back(entry(f, t.joints + r));
    }
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
  for (int f = 0; f < count; ++f)
    for (int i = 0; i < t.velocities; ++i)
      if (const int shared = entry_of(t.matrix, i, t.velocity_of(rows.pivot[f])); shared >= 0)
        by_velocity[i].push_back({shared, f});
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
