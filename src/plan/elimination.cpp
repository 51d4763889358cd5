// The followers of always-hard couplings, eliminated: v = S z + w, (M39). SPDX-License-Identifier: Apache-2.0
//
// J is constant, so S is, and with per-environment gear ratios its pattern is.
#include <algorithm>
#include <cmath>
#include <Eigen/Core>

#include "layout.h"

namespace lockstep {
namespace {

// A coupling's first joint is its follower unless another one's coefficient is this many times larger.
constexpr double preference = 1000.0;

struct HardRows {
  std::vector<int> coupling;  // by follower
  std::vector<int> pivot;     // its follower joint
  Eigen::MatrixXd form;       // Gauss-Jordan: J, then the identity; pivot columns cleared but for the pivot
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
  rows.form.setZero(count, t.joints + count);
  for (int r = 0; r < count; ++r) {
    const int c = rows.coupling[r];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) rows.form(r, t.term_joint[k]) = t.term_value[k];
    rows.form(r, t.joints + r) = 1.0;
  }
  for (int p = 0; p < count; ++p) {
    const Eigen::VectorXd row = rows.form.row(p).head(t.joints).cwiseAbs();
    int pivot = 0;
    const double largest = row.maxCoeff(&pivot);
    const int first = t.term_joint[t.term_start[rows.coupling[p]]];
    if (!is_pivot(rows, first) && row[first] * preference >= largest) pivot = first;
    rows.pivot.push_back(pivot);
    for (int r = 0; r < count; ++r) {
      if (r == p || rows.form(r, pivot) == 0.0) continue;
      rows.form.row(r) -= rows.form(r, pivot) / rows.form(p, pivot) * rows.form.row(p);
      rows.form(r, pivot) = 0.0;
    }
  }
  return rows;
}

// The same elimination on the pattern alone, recorded as the operations a lane repeats with its own ratios.
// Leaves in `pattern` where the final entries stand (-1: structurally zero).
Eigen::MatrixXi record_elimination(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  const int count = static_cast<int>(rows.coupling.size());
  Eigen::MatrixXi entry = Eigen::MatrixXi::Constant(count, rows.form.cols(), -1);
  std::vector<Reduction<double>::Fill> fills;
  std::vector<Reduction<double>::Elimination> eliminations;
  std::vector<Reduction<double>::Update> updates;
  std::vector<int> pivots;
  int entries = 0;
  const auto fill = [&](int r, int column, int gear, double value) {
    entry(r, column) = entries;
    fills.push_back({entries++, gear, value});
  };
  for (int r = 0; r < count; ++r) {
    const int c = rows.coupling[r];
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) fill(r, t.term_joint[k], t.term_gear[k], t.term_value[k]);
    fill(r, t.joints + r, -1, 1.0);
  }
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
  reduction.fills = program.store.keep(std::move(fills));
  reduction.eliminations = program.store.keep(std::move(eliminations));
  reduction.updates = program.store.keep(std::move(updates));
  reduction.pivot = program.store.keep(std::move(pivots));
  return entry;
}

// Couplings in an order in which each can place its first joint by joints that are placed already. None where followers
// are other joints, or follow each other in a ring.
std::vector<int> placing_order(const Tables<double>& t, const HardRows& rows) {
  std::vector<int> order, left = rows.coupling;
  const auto first_joint = [&](int c) { return t.term_joint[t.term_start[c]]; };
  for (std::size_t p = 0; p < rows.pivot.size(); ++p)
    if (rows.pivot[p] != first_joint(rows.coupling[p])) return {};
  const auto waits = [&](int c) {
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k)
      if (std::any_of(left.begin(), left.end(), [&](int other) { return t.term_joint[k] == first_joint(other); }))
        return true;
    return false;
  };
  while (!left.empty()) {
    const auto next = std::find_if_not(left.begin(), left.end(), waits);
    if (next == left.end()) return {};
    order.push_back(*next);
    left.erase(next);
  }
  return order;
}

// Empty unless each follower's coupling has one joint beside it, which follows nobody.
std::vector<Pair> find_pairs(const Tables<double>& t) {
  const Reduction<double>& r = t.reduction;
  std::vector<Pair> pairs;
  for (int i = 0; i < r.placing.count; ++i) {
    const int c = r.placing[i], first = t.term_start[c], driver = first + 1;
    if (t.term_start[c + 1] != first + 2 || r.follower_of[t.term_joint[driver]] >= 0) return {};
    const int f = r.follower_of[t.term_joint[first]];
    pairs.push_back({t.term_joint[first], t.term_joint[driver], c, driver, r.start[f]});
  }
  return pairs;
}

// What a step of followers that are all in place does without. Diagnostics ask what corrections did.
void find_what_shortens(Program& program, const HardRows& rows) {
  Tables<double>& t = program.f64;
  Reduction<double>& r = t.reduction;
  if (program.integrator != Integrator::euler) return;
  r.placing = program.store.keep(placing_order(t, rows));
  r.shortens = r.placing.count > 0 && !program.settings.record_diagnostics;
  r.pairs = program.store.keep(find_pairs(t));
  if (!r.shortens || declared(program, Parameter::gear_ratio) || declared(program, Parameter::offset)) return;
  const int first = t.floating ? 1 : 0;
  std::vector<Mirror> mirrors;
  for (int b = first; b < t.bodies; ++b) {
    const int f = r.follower_of[b - first];
    if (f < 0 || r.start[f + 1] != r.start[f] + 1) continue;
    const int driver = first + r.driver[r.start[f]];
    const double share = r.value[r.start[f]];
    bool shifted = false;
    for (int s = r.inverse_start[f]; s < r.inverse_start[f + 1]; ++s) shifted |= t.offset[r.inverse_coupling[s]] != 0.0;
    if (t.body[b].prismatic || t.body[driver].prismatic || std::abs(share) != 1.0 || shifted) continue;
    mirrors.push_back({b, driver, share * t.body[b].sign * t.body[driver].sign < 0.0});
  }
  r.mirrors = program.store.keep(std::move(mirrors));
}

struct Share {  // one entry of S
  int column;
  double value;
  int index;  // in Reduction::value, -1 for the 1 of an independent velocity
};

}  // namespace

void eliminate_followers(Program& program) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  Store& store = program.store;
  const bool gears_differ = declared(program, Parameter::gear_ratio);
  const HardRows rows = gauss_jordan(program);
  const int followers = static_cast<int>(rows.coupling.size());
  if (followers == 0) return;
  const int root = t.velocities - t.joints;
  Eigen::MatrixXi entry;
  if (gears_differ) entry = record_elimination(program, rows);
  const auto present = [&](int f, int column) {
    return gears_differ ? entry(f, column) >= 0 : rows.form(f, column) != 0.0;
  };

  // S over the independent velocities in their natural order, to learn the pattern of A_r.
  std::vector<int> independents, natural(t.velocities, -1);
  for (int i = 0; i < t.velocities; ++i)
    if (i < root || !is_pivot(rows, i - root)) {
      natural[i] = static_cast<int>(independents.size());
      independents.push_back(i);
    }
  std::vector<std::vector<int>> natural_shares(t.velocities);
  for (int i : independents) natural_shares[i] = {natural[i]};
  for (int f = 0; f < followers; ++f)
    for (int j = 0; j < t.joints; ++j)
      if (j != rows.pivot[f] && present(f, j)) natural_shares[root + rows.pivot[f]].push_back(natural[root + j]);
  const int n = static_cast<int>(independents.size());
  Pattern pattern(n, std::vector<char>(n, 0));
  for (int i = 0; i < t.velocities; ++i)
    for (int j = 0; j <= i; ++j)
      if (entry_of(t.matrix, i, j) >= 0)
        for (int a : natural_shares[i])
          for (int b : natural_shares[j]) pattern[std::max(a, b)][std::min(a, b)] = 1;
  const Elimination tree = elimination_tree(pattern);
  t.solver = make_columns(tree.parent, store);

  // S, and the error's share of each follower, in the solver's numbering.
  std::vector<int> independent(n), solver(t.velocities, -1);
  for (int z = 0; z < n; ++z) {
    independent[z] = independents[tree.order[z]];
    solver[independent[z]] = z;
  }
  std::vector<std::vector<Share>> shares(t.velocities);
  for (int i : independents) shares[i] = {{solver[i], 1.0, -1}};
  std::vector<int> start{0}, column, driver, value_entry, inverse_start{0}, inverse_coupling, inverse_entry;
  std::vector<double> value, inverse_value;
  for (int f = 0; f < followers; ++f) {
    const double pivot = rows.form(f, rows.pivot[f]);
    for (int j = 0; j < t.joints; ++j) {
      if (j == rows.pivot[f] || !present(f, j)) continue;
      shares[root + rows.pivot[f]].push_back({solver[root + j], -rows.form(f, j) / pivot, static_cast<int>(value.size())});
      column.push_back(solver[root + j]);
      driver.push_back(j);
      value.push_back(-rows.form(f, j) / pivot);
      if (gears_differ) value_entry.push_back(entry(f, j));
    }
    start.push_back(static_cast<int>(value.size()));
    for (int r = 0; r < followers; ++r) {
      if (!present(f, t.joints + r)) continue;
      inverse_coupling.push_back(rows.coupling[r]);
      inverse_value.push_back(rows.form(f, t.joints + r) / pivot);
      if (gears_differ) inverse_entry.push_back(entry(f, t.joints + r));
    }
    inverse_start.push_back(static_cast<int>(inverse_coupling.size()));
  }

  std::vector<std::vector<Collected>> by_solver(n);
  std::vector<std::vector<Momentum>> by_velocity(t.velocities);
  for (int f = 0; f < followers; ++f) {
    const int velocity = root + rows.pivot[f];
    for (int s = start[f]; s < start[f + 1]; ++s) by_solver[column[s]].push_back({velocity, s});
    for (int i = 0; i < t.velocities; ++i)
      if (const int shared = entry_of(t.matrix, i, velocity); shared >= 0) by_velocity[i].push_back({shared, f});
  }
  std::tie(reduction.collect_start, reduction.collected) = flattened(by_solver, store);
  std::tie(reduction.momentum_start, reduction.momentum) = flattened(by_velocity, store);

  // A_r = S^T A S, entry by entry: sums of entries of A with products of two entries of S.
  struct Product {
    int source;
    double value;
    int left, right;
  };
  std::vector<std::vector<Product>> products(t.solver.entries);
  for (int i = 0; i < t.velocities; ++i)
    for (int j = 0; j < t.velocities; ++j) {
      const int source = entry_of(t.matrix, i, j);
      if (source < 0) continue;
      for (const Share& a : shares[i])
        for (const Share& b : shares[j]) {
          if (a.column < b.column) continue;
          std::vector<Product>& sum = products[entry_of(t.solver, a.column, b.column)];
          const auto same = std::find_if(sum.begin(), sum.end(), [&](const Product& p) { return p.source == source; });
          if (same != sum.end() && !gears_differ)
            same->value += a.value * b.value;
          else
            sum.push_back({source, a.value * b.value, a.index, b.index});
        }
    }
  std::vector<int> product_start{0}, product_source, left, right;
  std::vector<double> product_value, rate(t.couplings, 0.0);
  for (const std::vector<Product>& sum : products) {
    for (const Product& p : sum) {
      product_source.push_back(p.source);
      product_value.push_back(p.value);
      left.push_back(p.left);
      right.push_back(p.right);
    }
    product_start.push_back(static_cast<int>(product_source.size()));
  }
  for (int c : rows.coupling) rate[c] = t.softness_first[c] / program.length;
  for (int joint : rows.pivot) program.eliminated.push_back(t.joint_row[joint]);

  reduction.followers = followers;
  reduction.follower = store.keep(rows.pivot);
  std::vector<int> follower_of(t.joints, -1);
  for (int f = 0; f < followers; ++f) follower_of[rows.pivot[f]] = f;
  reduction.follower_of = store.keep(std::move(follower_of));
  reduction.independent = store.keep(std::move(independent));
  reduction.start = store.keep(std::move(start));
  reduction.column = store.keep(std::move(column));
  reduction.driver = store.keep(std::move(driver));
  reduction.value = store.keep(std::move(value));
  reduction.inverse_start = store.keep(std::move(inverse_start));
  reduction.inverse_coupling = store.keep(std::move(inverse_coupling));
  reduction.inverse_value = store.keep(std::move(inverse_value));
  reduction.rate = store.keep(std::move(rate));
  reduction.product_start = store.keep(std::move(product_start));
  reduction.product_source = store.keep(std::move(product_source));
  reduction.product_value = store.keep(std::move(product_value));
  reduction.product_left = store.keep(std::move(left));
  reduction.product_right = store.keep(std::move(right));
  reduction.value_entry = store.keep(std::move(value_entry));
  reduction.inverse_entry = store.keep(std::move(inverse_entry));
  find_what_shortens(program, rows);
}

}  // namespace lockstep
