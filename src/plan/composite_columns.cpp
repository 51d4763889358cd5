// A_r from composite columns, which joints of one velocity share (M41). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <tuple>
#include <vector>

#include "layout.h"

namespace lockstep {
namespace {

// One entry of S.
struct Share {
  int column;  // solver velocity
  int index;   // in Reduction::value, -1 for a 1 that is not stored there
};

// The work that composite columns save: columns of M past bodies, products for A_r, products of A with corrections.
long work_by_entries(const Tables<double>& t) {
  long work = work::short_product * (t.reduction.product_source.count + t.reduction.momentum.count);
  for (int i = t.root_velocities(); i < t.matrix.n; ++i)
    if (t.matrix.parent[i] >= 0) work += work::column_past_body * t.matrix.size[i];
  return work;
}

class ColumnBuilder {
 public:
  explicit ColumnBuilder(const Tables<double>& t)
      : t_(t), n_(t.solver.n), root_(t.root_velocities()), shares_(t.bodies), follower_(t.bodies, -1) {
    const Reduction<double>& r = t.reduction;
    has_corrections_ = t.solve_twice && t.integrator != Integrator::runge_kutta;
    for (int z = 0; z < n_; ++z)
      if (r.independent[z] >= root_) shares_[body_of(r.independent[z] - root_)].push_back({z, -1});
    for (int f = 0; f < r.followers; ++f) {
      const int body = body_of(r.follower[f]);
      for (int s = r.start[f]; s < r.start[f + 1]; ++s) shares_[body].push_back({r.column[s], s});
      follower_[body] = f;
    }
  }

  std::pair<CompositeColumns, long> build(TableStorage& storage) {
    using M = CompositeColumns;
    const int bodies = t_.bodies;
    std::vector<std::vector<Merge>> merges(bodies);
    std::vector<std::vector<M::Row>> rows(bodies), pulls(bodies);
    std::vector<std::vector<M::Square>> squares(bodies), pulled(bodies);
    std::vector<std::vector<M::Unit>> units(bodies);
    std::vector<M::Correction> correction(bodies, M::Correction{-1, false});
    std::vector<std::vector<int>> passed(bodies);
    // By body: the place of each velocity's column. Velocity n_ stands for the column of corrections.
    std::vector<std::map<int, int>> carried(bodies);
    for (int b = bodies - 1; b >= 0; --b) {
      std::map<int, int>& places = carried[b];
      for (int child = b + 1; child < bodies; ++child) {
        if (t_.body[child].parent != b) continue;
        for (const auto& [column, place] : carried[child]) {
          const auto [known, is_new] = places.emplace(column, place);
          if (is_new) continue;
          merges[b].push_back({place, known->second});
          free_.push_back(place);
        }
      }
      if (t_.body[b].root) {
        for (const auto& [column, place] : places)
          for (int k = 0; k < root_; ++k) rows[b].push_back({place, entry(column, k), k});
        continue;
      }
      const bool corrected = has_corrections_ && follower_[b] >= 0;
      for (const auto& [column, place] : places) {
        for (const Share& own : shares_[b])  // A_r is symmetric: a term on its diagonal counts twice
          rows[b].push_back({place, entry(column, own.column), factor(own.index, -1, column == own.column ? 2 : 1)});
        if (corrected && column < n_) pulls[b].push_back({place, entry(column, n_), -1});
      }
      for (std::size_t i = 0; i < shares_[b].size(); ++i) {
        const Share& own = shares_[b][i];
        for (std::size_t k = 0; k <= i; ++k)
          squares[b].push_back({entry(own.column, shares_[b][k].column), factor(own.index, shares_[b][k].index, 1)});
        if (corrected) pulled[b].push_back({entry(own.column, n_), factor(own.index, -1, 1)});
      }
      if (t_.body[b].parent >= 0) {
        const auto place_of = [&](int column, bool& first) {
          first = places.count(column) == 0;
          if (first) places[column] = take_place();
          return places[column];
        };
        for (const Share& own : shares_[b]) {
          M::Unit unit{0, factor(own.index, -1, 1), false};
          unit.place = place_of(own.column, unit.first);
          units[b].push_back(unit);
        }
        if (corrected) correction[b].place = place_of(n_, correction[b].first);
        for (const auto& [column, place] : places) passed[b].push_back(place);
        std::sort(passed[b].begin(), passed[b].end());
      } else {
        for (const auto& [column, place] : places) free_.push_back(place);
      }
      work_ += work::column_past_body * static_cast<long>(passed[b].size()) +
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
  int body_of(int joint) const { return joint + (t_.floating ? 1 : 0); }
  // S^T A times the corrections is stored after A_r.
  int entry(int one, int other) const {
    return std::max(one, other) < n_ ? entry_of(t_.solver, one, other) : t_.solver.entries + std::min(one, other);
  }
  int factor(int left, int right, int times) {
    for (std::size_t i = 0; i < factors_.size(); ++i)
      if (factors_[i].left == left && factors_[i].right == right && factors_[i].times == times)
        return static_cast<int>(i);
    factors_.push_back({left, right, times});
    return static_cast<int>(factors_.size()) - 1;
  }
  int take_place() {
    if (free_.empty()) return places_++;
    const auto lowest = std::min_element(free_.begin(), free_.end());
    const int place = *lowest;
    free_.erase(lowest);
    return place;
  }

  const Tables<double>& t_;
  int n_, root_, places_ = 0;
  bool has_corrections_;  // the position phase has a solution of its own
  long work_ = 0;
  std::vector<int> free_;
  std::vector<CompositeColumns::Factor> factors_;
  std::vector<std::vector<Share>> shares_;  // by body: the joint's row of S
  std::vector<int> follower_;               // by body: its joint's number among the followers, -1 if independent
};

}  // namespace

std::pair<CompositeColumns, long> composite_columns(const Tables<double>& t, TableStorage& storage) {
  return ColumnBuilder(t).build(storage);
}

void take_composite_columns(Program& program) {
  Tables<double>& t = program.f64;
  if (!t.reduction.eliminates()) return;
  t.reduction.removes_by_force =
      program.integrator == Integrator::euler || program.integrator == Integrator::runge_kutta;
  if (!t.reduction.removes_by_force || t.undamped.count > 0 || program.settings.record_impulses) return;
  const auto [columns, work] = composite_columns(t, program.storage);
  if (columns.places > 0 && work < work_by_entries(t)) t.reduction.composite = columns;
}

}  // namespace lockstep
