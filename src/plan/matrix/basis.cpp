// S of v = S z: all velocities in terms of the solver's, (M39), (M77). SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

struct Share {  // one entry of S
  int column;
  double value;
  int index;  // in Reduction::value, -1 for a 1 that is not stored there
};

// The solver's velocities before they are renumbered: constraint velocities first, as they are eliminated last, then
// the independent velocities.
std::vector<int> initial_order(const Tables<double>& t, const std::vector<Follower>& followers,
                               bool has_constraint_velocities) {
  std::vector<char> follows(t.velocities, 0);
  std::vector<int> order;
  for (const Follower& follower : followers) {
    follows[t.velocity_of(follower.joint)] = 1;
    if (has_constraint_velocities) order.push_back(t.velocity_of(follower.joint));
  }
  for (int i = 0; i < t.velocities; ++i)
    if (!follows[i]) order.push_back(i);
  return order;
}

// The pattern of H = S^T A S. `parts` names, by velocity, the solver velocities that it depends on: all of them are
// joined, and with those of the velocities of which A has entries.
Pattern pattern_of(const Tables<double>& t, std::vector<std::vector<int>> parts, int n) {
  Pattern pattern(n);
  for (int i = 0; i < t.velocities; ++i) {
    pattern.join_all(parts[i]);
    for (int j = t.matrix.parent[i]; j >= 0 && !parts[i].empty(); j = t.matrix.parent[j])
      if (!parts[j].empty()) pattern.join(parts[i].back(), parts[j].back());
  }
  return pattern;
}

// A_r = S^T A S, entry by entry: each is a sum of entries of A, times two entries of S.
void lay_out_products(Program& program, const std::vector<std::vector<Share>>& shares) {
  Tables<double>& t = program.f64;
  struct Product {
    int source;
    double value;
    int left, right;
  };

  // By entry of A_r: its products. Unless ratios differ, those with the same entry of A are one product: each entry is
  // met twice, from either side of the diagonal.
  struct Known {
    int entry;
    std::size_t place;  // of its product
  };
  std::vector<std::vector<Product>> products(t.solver.entries);
  std::vector<Known> known;
  std::vector<std::pair<std::size_t, std::size_t>> known_of(t.matrix.entries);  // by entry of A, when it is met again
  const bool merges = !shares_differ(program);
  const auto comes_before = [](const Known& one, const Known& other) { return one.entry < other.entry; };
  const auto add = [&](int i, int j) {
    const int source = entry_of(t.matrix, i, j);
    const auto [first, last] = known_of[source];
    const std::size_t before = known.size();
    for (const Share& a : shares[i])
      for (const Share& b : shares[j]) {
        if (a.column < b.column) continue;
        const int entry = entry_of(t.solver, a.column, b.column);
        std::vector<Product>& sum = products[entry];
        if (first < last) {
          const Known *const begin = known.data() + first, *const end = known.data() + last;
          const Known* const met = std::lower_bound(begin, end, Known{entry, 0}, comes_before);
          if (met != end && met->entry == entry) {
            sum[met->place].value += a.value * b.value;
            continue;
          }
        }
        if (merges && i < j) known.push_back({entry, sum.size()});
        sum.push_back({source, a.value * b.value, a.index, b.index});
      }
    if (known.size() == before) return;
    std::sort(known.begin() + static_cast<std::ptrdiff_t>(before), known.end(), comes_before);
    known_of[source] = {before, known.size()};
  };
  std::vector<int> ancestors;
  for (int i = 0; i < t.velocities; ++i) {
    ancestors.clear();
    for (int j = t.matrix.parent[i]; j >= 0; j = t.matrix.parent[j]) ancestors.push_back(j);
    for (auto j = ancestors.rbegin(); j != ancestors.rend(); ++j) add(i, *j);
    for (int j = i; j < i + t.matrix.size[i]; ++j) add(i, j);
  }

  // Entries with equally many products follow each other: the kernels' loops then have one length for a group.
  std::vector<int> entries(products.size()), start{0}, source, left, right;
  for (std::size_t e = 0; e < entries.size(); ++e) entries[e] = static_cast<int>(e);
  std::stable_sort(entries.begin(), entries.end(),
                   [&](int a, int b) { return products[a].size() < products[b].size(); });
  std::vector<double> value;
  std::vector<ProductGroup> groups;
  for (int place = 0; place < static_cast<int>(entries.size()); ++place) {
    const std::vector<Product>& sum = products[entries[place]];
    const int count = static_cast<int>(sum.size());
    if (groups.empty() || groups.back().count != count) groups.push_back({place, place, count});
    ++groups.back().last;
    for (const Product& p : sum) {
      source.push_back(p.source);
      value.push_back(p.value);
      left.push_back(p.left);
      right.push_back(p.right);
    }
    start.push_back(static_cast<int>(source.size()));
  }

  Reduction<double>& reduction = t.reduction;
  reduction.product_groups = program.storage.keep(std::move(groups));
  reduction.product_entry = program.storage.keep(std::move(entries));
  reduction.product_start = program.storage.keep(std::move(start));
  reduction.product_source = program.storage.keep(std::move(source));
  reduction.product_value = program.storage.keep(std::move(value));
  reduction.product_left = program.storage.keep(std::move(left));
  reduction.product_right = program.storage.keep(std::move(right));
}

}  // namespace

void lay_out_basis(Program& program, const std::vector<Follower>& followers, bool has_constraint_velocities) {
  Tables<double>& t = program.f64;
  Reduction<double>& reduction = t.reduction;
  TableStorage& storage = program.storage;

  require_room(program, t.matrix.entries, the_mass_matrix);

  // By velocity: the solver velocities that it depends on, in the initial order.
  const std::vector<int> order = initial_order(t, followers, has_constraint_velocities);
  const int n = static_cast<int>(order.size());
  std::vector<int> place(t.velocities, -1);  // by velocity: in the initial order
  for (int z = 0; z < n; ++z) place[order[z]] = z;
  std::vector<std::vector<int>> parts(t.velocities);
  for (int i : order) parts[i] = {place[i]};
  for (const Follower& follower : followers)
    for (const auto& [velocity, value] : follower.shares)
      parts[t.velocity_of(follower.joint)].push_back(place[velocity]);

  // The pattern of A_r with its fill, and the depth-first numbering of its elimination.
  Pattern pattern = pattern_of(t, parts, n);
  add_folded(program, parts, pattern);
  const Elimination tree = elimination_tree(pattern);
  require_room(program, entries_of(tree.parent), "the mass matrix of its independent joints");
  t.solver = make_columns(tree.parent, storage);

  // Velocities and floating roots in that numbering.
  std::vector<int> independent(n), solver(t.velocities, -1);
  for (int z = 0; z < n; ++z) {
    independent[z] = order[tree.order[z]];
    solver[independent[z]] = z;
  }
  std::vector<FloatingRoot> roots(t.roots.data, t.roots.data + t.roots.count);
  for (FloatingRoot& root : roots) root.solver = solver[root.velocity];
  t.roots = storage.keep(std::move(roots));

  // S by rows, with a 1 where a velocity is the solver's own, and S^T of the followers.
  std::vector<std::vector<Share>> shares(t.velocities);
  for (int i : order) shares[i] = {{solver[i], 1.0, -1}};
  std::vector<int> follower_joint, follower_of(t.joints, -1), start{0}, column, leader, constraint_velocity;
  std::vector<double> value;
  std::vector<std::vector<Collected>> by_solver(n);
  std::vector<int> joint_of(t.velocities, -1);
  for (int j = 0; j < t.joints; ++j) joint_of[t.velocity_of(j)] = j;
  for (const Follower& follower : followers) {
    const int velocity = t.velocity_of(follower.joint);
    follower_of[follower.joint] = static_cast<int>(follower_joint.size());
    follower_joint.push_back(follower.joint);
    if (has_constraint_velocities) constraint_velocity.push_back(solver[velocity]);
    for (const auto& [other, share] : follower.shares) {
      const int z = solver[other], index = static_cast<int>(value.size());
      shares[velocity].push_back({z, share, index});
      by_solver[z].push_back({velocity, index});
      column.push_back(z);
      leader.push_back(joint_of[other]);
      value.push_back(share);
    }
    start.push_back(static_cast<int>(value.size()));
  }

  std::tie(reduction.collect_start, reduction.collected) = flattened(by_solver, storage);
  lay_out_products(program, shares);
  reduction.followers = static_cast<int>(followers.size());
  reduction.follower = storage.keep(std::move(follower_joint));
  reduction.follower_of = storage.keep(std::move(follower_of));
  reduction.constraint_velocity = storage.keep(std::move(constraint_velocity));
  reduction.independent = storage.keep(std::move(independent));
  reduction.start = storage.keep(std::move(start));
  reduction.column = storage.keep(std::move(column));
  reduction.leader = storage.keep(std::move(leader));
  reduction.value = storage.keep(std::move(value));
}

}  // namespace lockstep
