// A_r from composite columns, which joints of one velocity share (M41). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "plan/layout.h"

namespace lockstep {
namespace {

// One entry of S.
struct ColumnShare {
  int column;  // solver velocity
  int index;   // in Reduction::value, -1 for a 1 that is not stored there
};

// By tree, the work that composite columns save: columns of M past bodies, products for A_r, products of A with
// corrections.
std::vector<long> work_by_entries(const Tables<double>& t) {
  const Reduction<double>& r = t.reduction;
  const std::vector<int> tree = trees_of_velocities(t), column = columns_of_entries(t.solver);
  std::vector<long> work(t.tree.count, 0);
  for (int e = 0; e < r.product_entry.count; ++e)
    work[tree[r.independent[column[r.product_entry[e]]]]] +=
        work::short_product * (r.product_start[e + 1] - r.product_start[e]);
  for (int i = 0; i < t.velocities; ++i)
    work[tree[i]] += work::short_product * (r.momentum_start[i + 1] - r.momentum_start[i]);
  for (int j = 0; j < t.joints; ++j)
    if (const int i = t.velocity_of(j); t.matrix.parent[i] >= 0)
      work[tree[i]] += work::column_past_body * t.matrix.size[i];
  return work;
}

// What trees with composite columns do not need: products for A_r, and products of A with corrections.
void drop_entries(Program& program, const std::vector<bool>& trees) {
  Tables<double>& t = program.f64;
  Reduction<double>& r = t.reduction;
  const std::vector<int> tree = trees_of_velocities(t), column = columns_of_entries(t.solver);

  // Products of the other trees, in their groups.
  std::vector<ProductGroup> groups;
  std::vector<int> entry, start{0}, source, left, right;
  std::vector<double> value;
  for (int g = 0; g < r.product_groups.count; ++g) {
    ProductGroup group{static_cast<int>(entry.size()), 0, r.product_groups[g].count};
    for (int e = r.product_groups[g].first; e < r.product_groups[g].last; ++e) {
      if (trees[tree[r.independent[column[r.product_entry[e]]]]]) continue;
      entry.push_back(r.product_entry[e]);
      for (int p = r.product_start[e]; p < r.product_start[e + 1]; ++p) {
        source.push_back(r.product_source[p]);
        value.push_back(r.product_value[p]);
        left.push_back(r.product_left[p]);
        right.push_back(r.product_right[p]);
      }
      start.push_back(static_cast<int>(source.size()));
    }
    group.last = static_cast<int>(entry.size());
    if (group.first < group.last) groups.push_back(group);
  }

  // Products with corrections, of the other trees.
  std::vector<std::vector<Momentum>> momentum(t.velocities);
  for (int i = 0; i < t.velocities; ++i)
    if (!trees[tree[i]])
      momentum[i].assign(r.momentum.data + r.momentum_start[i], r.momentum.data + r.momentum_start[i + 1]);

  TableStorage& storage = program.storage;
  r.product_groups = storage.keep(std::move(groups));
  r.product_entry = storage.keep(std::move(entry));
  r.product_start = storage.keep(std::move(start));
  r.product_source = storage.keep(std::move(source));
  r.product_value = storage.keep(std::move(value));
  r.product_left = storage.keep(std::move(left));
  r.product_right = storage.keep(std::move(right));
  std::tie(r.momentum_start, r.momentum) = flattened(momentum, storage);
}

class ColumnBuilder {
 public:
  ColumnBuilder(const Tables<double>& t, const std::vector<bool>& trees)
      : t_(t), trees_(trees), n_(t.solver.n), work_(t.tree.count, 0), shares_(t.bodies), follower_(t.bodies, -1) {
    const Reduction<double>& r = t.reduction;
    has_corrections_ = t.solve_twice && t.integrator != Integrator::runge_kutta;
    std::vector<int> body_of_velocity(t.velocities, -1);
    for (int b = 0; b < t.bodies; ++b)
      if (!t.body[b].root) body_of_velocity[t.body[b].velocity] = b;
    for (int z = 0; z < n_; ++z)
      if (const int b = body_of_velocity[r.independent[z]]; b >= 0) shares_[b].push_back({z, -1});
    for (int f = 0; f < r.followers; ++f) {
      const int body = t.joint_body[r.follower[f]];
      for (int s = r.start[f]; s < r.start[f + 1]; ++s) shares_[body].push_back({r.column[s], s});
      follower_[body] = f;
    }
  }

  std::pair<CompositeColumns, std::vector<long>> build(TableStorage& storage) {
    using M = CompositeColumns;
    const int bodies = t_.bodies;

    // By body: what a step does there.
    std::vector<std::vector<Merge>> merges(bodies);
    std::vector<std::vector<M::Row>> rows(bodies), pulls(bodies);
    std::vector<std::vector<M::Square>> squares(bodies), pulled(bodies);
    std::vector<std::vector<M::Unit>> units(bodies);
    std::vector<M::Correction> correction(bodies, M::Correction{-1, false});
    std::vector<std::vector<int>> passed(bodies);
    // By body: the place of each velocity's column. Velocity n_ stands for the column of corrections.
    std::vector<std::map<int, int>> carried(bodies);
    std::vector<std::vector<int>> children(bodies);
    for (int b = 0; b < bodies; ++b)
      if (t_.body[b].parent >= 0) children[t_.body[b].parent].push_back(b);
    for (int b = bodies - 1; b >= 0; --b) {
      if (!trees_[t_.body[b].tree]) continue;

      // Columns arrive from the children. Two of one velocity become one.
      std::map<int, int>& places = carried[b];
      for (const int child : children[b]) {
        if (places.empty()) {
          places.swap(carried[child]);
          continue;
        }
        for (const auto& [column, place] : carried[child]) {
          const auto [known, is_new] = places.emplace(column, place);
          if (is_new) continue;
          merges[b].push_back({place, known->second});
          free_.insert(place);
        }
      }

      // At a floating root they end. Their six components are entries of A_r.
      if (t_.body[b].root) {
        const int root = t_.roots[t_.body[b].joint].solver;
        for (const auto& [column, place] : places)
          for (int k = 0; k < 6; ++k) rows[b].push_back({place, entry(column, root + k), k});
        for (const auto& [column, place] : places) free_.insert(place);
        continue;
      }

      // Components along the joint (M41): of the columns that arrive, then of the joint's own.
      const bool corrected = has_corrections_ && follower_[b] >= 0;
      for (const auto& [column, place] : places) {
        for (const ColumnShare& own : shares_[b])  // A_r is symmetric: a term on its diagonal counts twice
          rows[b].push_back({place, entry(column, own.column), factor(own.index, -1, column == own.column ? 2 : 1)});
        if (corrected && column < n_) pulls[b].push_back({place, entry(column, n_), -1});
      }
      for (std::size_t i = 0; i < shares_[b].size(); ++i) {
        const ColumnShare& own = shares_[b][i];
        for (std::size_t k = 0; k <= i; ++k)
          squares[b].push_back({entry(own.column, shares_[b][k].column), factor(own.index, shares_[b][k].index, 1)});
        if (corrected) pulled[b].push_back({entry(own.column, n_), factor(own.index, -1, 1)});
      }

      // The joint's own columns join those that pass on to the parent. At a fixed root all end.
      if (t_.body[b].parent >= 0) {
        const auto place_of = [&](int column, bool& first) {
          first = places.count(column) == 0;
          if (first) places[column] = take_place();
          return places[column];
        };
        for (const ColumnShare& own : shares_[b]) {
          M::Unit unit{0, factor(own.index, -1, 1), false};
          unit.place = place_of(own.column, unit.first);
          units[b].push_back(unit);
        }
        if (corrected) correction[b].place = place_of(n_, correction[b].first);
        for (const auto& [column, place] : places) passed[b].push_back(place);
        std::sort(passed[b].begin(), passed[b].end());
      } else {
        for (const auto& [column, place] : places) free_.insert(place);
      }

      // What that costs a step.
      work_[t_.body[b].tree] +=
          work::column_past_body * static_cast<long>(passed[b].size()) +
          work::addition_to_entry * static_cast<long>(rows[b].size() + pulls[b].size() + squares[b].size() +
                                                      pulled[b].size() + 2 * units[b].size());
    }

    M all;
    all.places = places_;
    all.factors = storage.keep(factors_);
    std::tie(all.merge_start, all.merges) = flattened(merges, storage);
    std::tie(all.row_start, all.rows) = flattened(rows, storage);
    std::tie(all.pull_start, all.pulls) = flattened(pulls, storage);
    std::tie(all.square_start, all.squares) = flattened(squares, storage);
    std::tie(all.pulled_start, all.pulled) = flattened(pulled, storage);
    std::tie(all.unit_start, all.units) = flattened(units, storage);
    std::tie(all.passed_start, all.passed) = flattened(passed, storage);
    all.correction = storage.keep(std::move(correction));
    return {all, work_};
  }

 private:
  // S^T A times the corrections is stored after A_r.
  int entry(int one, int other) const {
    return std::max(one, other) < n_ ? entry_of(t_.solver, one, other) : t_.solver.entries + std::min(one, other);
  }
  int factor(int left, int right, int times) {
    const auto [known, is_new] = numbers_.try_emplace({left, right, times}, static_cast<int>(factors_.size()));
    if (is_new) factors_.push_back({left, right, times});
    return known->second;
  }
  int take_place() {
    if (free_.empty()) return places_++;
    const int lowest = *free_.begin();
    free_.erase(free_.begin());
    return lowest;
  }

  const Tables<double>& t_;
  const std::vector<bool>& trees_;
  int n_, places_ = 0;
  bool has_corrections_;    // the position phase has a solution of its own
  std::vector<long> work_;  // by tree
  std::set<int> free_;
  std::vector<CompositeColumns::Factor> factors_;
  std::map<std::tuple<int, int, int>, int> numbers_;  // by factor: its number
  std::vector<std::vector<ColumnShare>> shares_;      // by body: the joint's row of S
  std::vector<int> follower_;  // by body: its joint's number among the followers, -1 if independent
};

}  // namespace

std::pair<CompositeColumns, std::vector<long>> composite_columns(const Tables<double>& t,
                                                                 const std::vector<bool>& trees,
                                                                 TableStorage& storage) {
  return ColumnBuilder(t, trees).build(storage);
}

void take_composite_columns(Program& program) {
  Tables<double>& t = program.f64;
  if (!t.reduction.removes_by_force || program.settings.record_impulses) return;

  // Components that may: they have followers, but no spatial tendons, and no row needs the undamped inertia.
  const std::vector<int> component = components(t), tree = trees_of_velocities(t);
  std::vector<char> follows(t.tree.count, 0), needs_entries(t.tree.count, 0);  // by component
  for (int f = 0; f < t.reduction.followers; ++f) follows[component[tree[t.velocity_of(t.reduction.follower[f])]]] = 1;
  for (int i = 0; i < t.undamped.support.count; ++i) needs_entries[component[tree[t.undamped.support[i].index]]] = 1;
  for (int i = 0; i < t.spatial.tendons.count; ++i)  // their rows of S have velocities of roots
    needs_entries[component[tree[t.velocity_of(t.spatial.tendons[i].joint)]]] = 1;
  std::vector<bool> trees(t.tree.count);
  std::vector<long> saved(t.tree.count, 0);  // by component
  for (int i = 0; i < t.tree.count; ++i) trees[i] = follows[component[i]] && !needs_entries[component[i]];

  // Components where it is less work, and where some column passes a body at all.
  const std::vector<long> by_entries = work_by_entries(t);
  const auto [columns, by_columns] = composite_columns(t, trees, program.storage);
  std::vector<char> passes(t.tree.count, 0);  // by component: some column passes a body
  for (int b = 0; b < t.bodies; ++b)
    if (columns.passed_start[b] < columns.passed_start[b + 1]) passes[component[t.body[b].tree]] = 1;
  for (int i = 0; i < t.tree.count; ++i) saved[component[i]] += by_entries[i] - by_columns[i];
  for (int i = 0; i < t.tree.count; ++i) trees[i] = trees[i] && passes[component[i]] && saved[component[i]] > 0;
  if (std::find(trees.begin(), trees.end(), true) != trees.end()) use_composite_columns(program, trees);
}

void use_composite_columns(Program& program, const std::vector<bool>& trees) {
  Tables<double>& t = program.f64;
  const std::vector<int> tree = trees_of_velocities(t);
  set_inertia(program, trees, InertiaKind::composite_columns);
  t.reduction.composite = composite_columns(t, trees, program.storage).first;
  std::vector<SupportRun> velocities;
  for (int z = 0; z < t.solver.n; ++z) {
    if (!trees[tree[t.reduction.independent[z]]]) continue;
    if (!velocities.empty() && velocities.back().last == z)
      ++velocities.back().last;
    else
      velocities.push_back({z, z + 1});
  }
  t.reduction.composite.velocities = program.storage.keep(std::move(velocities));
  drop_entries(program, trees);
}

}  // namespace lockstep
