// Routes of vectors over articulated bodies, where these are less work than A: (M22) to (M25). SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <vector>

#include "layout.h"

namespace lockstep {
namespace {

class Routes {
 public:
  explicit Routes(const Tables<double>& t) : t_(t), root_(t.velocities - t.joints) {}

  // Of vectors side by side: by body, which of them it moves.
  Route route(const std::vector<std::vector<int>>& moved) {
    const int begin = static_cast<int>(passes_.size());
    std::vector<std::map<int, int>> arrived(t_.bodies);  // by body: slots by vector
    std::vector<int> free;
    int taken = 0;
    for (int b = t_.bodies - 1; b >= 0; --b) {
      if (moved[b].empty()) continue;
      std::map<int, int>& known = arrived[b];
      Pass pass{b, static_cast<int>(joins_.size()), 0, static_cast<int>(travellers_.size()), 0, 0};
      for (int child = t_.bodies - 1; child > b; --child) {
        if (t_.body[child].parent != b) continue;
        for (const auto& [vector, slot] : arrived[child]) {
          const auto [there, fresh] = known.emplace(vector, slot);
          if (fresh) continue;
          joins_.push_back({slot, there->second});
          free.push_back(slot);
        }
      }
      std::map<int, int> fresh;
      for (const int vector : moved[b]) {
        if (known.count(vector)) continue;
        fresh[vector] = free.empty() ? taken++ : free.back();
        if (!free.empty()) free.pop_back();
      }
      const auto travel = [&](const std::map<int, int>& slots) {
        for (const auto& [vector, slot] : slots) travellers_.push_back({slot, vector});
        return static_cast<int>(travellers_.size());
      };
      pass.joined = static_cast<int>(joins_.size());
      pass.known = travel(fresh);
      pass.last = travel(known);
      passes_.push_back(pass);
      known.insert(fresh.begin(), fresh.end());
      if (t_.body[b].parent < 0)
        for (const auto& [vector, slot] : known) free.push_back(slot);
    }
    slots_ = std::max(slots_, taken);
    return {begin, static_cast<int>(passes_.size())};
  }

  Route route(const Rows<double>& rows, int first, int last) {
    std::vector<std::vector<int>> moved(t_.bodies);
    for (int r = first; r < last; ++r) {
      if (t_.floating) moved[0].push_back(r - first);
      for (int i = rows.run_start[r]; i < rows.run_start[r + 1]; ++i)
        for (int z = std::max(rows.runs[i].first, root_); z < rows.runs[i].last; ++z)
          moved[z - root_ + (t_.floating ? 1 : 0)].push_back(r - first);
    }
    return route(moved);
  }

  Articulated articulated(Store& store) {
    Articulated a;
    a.all = route(std::vector<std::vector<int>>(t_.bodies, {0}));
    a.rows = route(t_.rows, 0, t_.rows.count);
    std::vector<Route> bounds;
    for (int r = 0; r < t_.bounds.form.count; ++r) bounds.push_back(route(t_.bounds.form, r, r + 1));
    a.slots = slots_;
    a.passes = store.keep(passes_);
    a.travellers = store.keep(travellers_);
    a.joins = store.keep(joins_);
    a.bound = store.keep(std::move(bounds));
    std::vector<int> parents;
    for (int k = 0; k < root_; ++k) parents.push_back(k - 1);
    a.root = make_columns(parents, store);
    return a;
  }

 private:
  const Tables<double>& t_;
  int root_, slots_ = 0;
  std::vector<Pass> passes_;
  std::vector<Traveller> travellers_;
  std::vector<Join> joins_;
};

}  // namespace

Articulated articulated_bodies(const Tables<double>& t, Store& store) { return Routes(t).articulated(store); }

namespace {

// Nobody asks for A's own entries.
bool can_articulate(const Tables<double>& t) {
  return t.joints > 0 && t.reduction.followers == 0 && t.limited.count == 0;
}

// A made and factored, one solve with it, and the responses of rows. Whether natural rows take a mass matrix of their own
// is not asked: a limit that is never reached may not change a bit, so it may not change the way.
long work_by_matrix(const Tables<double>& t) {
  long work = 0;
  for (int i = 0; i < t.matrix.n; ++i) {
    const long ancestors = t.matrix.row_start[i + 1] - t.matrix.row_start[i];
    if (i >= t.velocities - t.joints) {
      work += work::column_of_joint;
      if (t.matrix.parent[i] >= 0) work += work::passing * t.matrix.size[i];
    }
    work += (ancestors + 2) * t.matrix.size[i];
  }
  for (int g = 0; g < t.rows.groups.count; ++g) {
    const RowGroup& group = t.rows.groups[g];
    for (int s = group.support_first; s < group.support_last; ++s)
      work += static_cast<long>(group.count) * (t.rows.group_support[s].end - t.rows.group_support[s].index);
  }
  return work;
}

long work_by_bodies(const Tables<double>& t, const Articulated& a) {
  long work = static_cast<long>(work::articulating) * t.joints;
  for (const Route& route : {a.all, a.all, a.rows})  // there and back, and the rows' responses
    for (int p = route.first; p < route.last; ++p) work += work::travelling * (a.passes[p].last - a.passes[p].fresh);
  return work;
}

}  // namespace

void articulate(Program& program) {
  Tables<double>& t = program.f64;
  if (!can_articulate(t)) return;
  const Articulated bodies = articulated_bodies(t, program.store);
  if (work_by_bodies(t, bodies) < work_by_matrix(t)) t.articulated = bodies;
}

}  // namespace lockstep
