// Articulated bodies instead of A, (M22) to (M25): paths of vectors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <vector>

#include "layout.h"

namespace lockstep {
namespace {

class Paths {
 public:
  explicit Paths(const Tables<double>& t) : t_(t), root_(t.root_velocities()) {}

  // The path of vectors side by side. `moved` names, by body, the vectors with an entry at its joint.
  Path path(const std::vector<std::vector<int>>& moved) {
    const int begin = static_cast<int>(visits_.size());
    std::vector<std::map<int, int>> arrived(t_.bodies);  // by body: place by vector
    std::vector<int> free;
    int taken = 0;
    for (int b = t_.bodies - 1; b >= 0; --b) {
      if (moved[b].empty()) continue;
      std::map<int, int>& known = arrived[b];
      Visit visit{b, static_cast<int>(merges_.size()), 0, static_cast<int>(carried_.size()), 0, 0};
      for (int child = t_.bodies - 1; child > b; --child) {
        if (t_.body[child].parent != b) continue;
        for (const auto& [vector, place] : arrived[child]) {
          const auto [entry, is_new] = known.emplace(vector, place);
          if (is_new) continue;
          merges_.push_back({place, entry->second});
          free.push_back(place);
        }
      }
      std::map<int, int> starting;
      for (const int vector : moved[b]) {
        if (known.count(vector)) continue;
        starting[vector] = free.empty() ? taken++ : free.back();
        if (!free.empty()) free.pop_back();
      }
      const auto carry = [&](const std::map<int, int>& places) {
        for (const auto& [vector, place] : places) carried_.push_back({place, vector});
        return static_cast<int>(carried_.size());
      };
      visit.merge_last = static_cast<int>(merges_.size());
      visit.known = carry(starting);
      visit.last = carry(known);
      visits_.push_back(visit);
      known.insert(starting.begin(), starting.end());
      if (t_.body[b].parent < 0)
        for (const auto& [vector, place] : known) free.push_back(place);
    }
    places_ = std::max(places_, taken);
    return {begin, static_cast<int>(visits_.size())};
  }

  // The path of the rows `first` to `last` - 1.
  Path path(const Rows<double>& rows, int first, int last) {
    std::vector<std::vector<int>> moved(t_.bodies);
    for (int r = first; r < last; ++r) {
      if (t_.floating) moved[0].push_back(r - first);
      for (int i = rows.run_start[r]; i < rows.run_start[r + 1]; ++i)
        for (int z = std::max(rows.runs[i].first, root_); z < rows.runs[i].last; ++z)
          moved[z - root_ + (t_.floating ? 1 : 0)].push_back(r - first);
    }
    return path(moved);
  }

  Articulated articulated(TableStorage& storage) {
    Articulated a;
    a.all = path(std::vector<std::vector<int>>(t_.bodies, {0}));
    a.rows = path(t_.rows, 0, t_.rows.count);
    std::vector<Path> bounds;
    for (int r = 0; r < t_.bounds.rows.count; ++r) bounds.push_back(path(t_.bounds.rows, r, r + 1));
    a.places = places_;
    a.visits = storage.keep(visits_);
    a.carried = storage.keep(carried_);
    a.merges = storage.keep(merges_);
    a.bounds = storage.keep(std::move(bounds));
    std::vector<int> parents;
    for (int k = 0; k < root_; ++k) parents.push_back(k - 1);
    a.root = make_columns(parents, storage);
    return a;
  }

 private:
  const Tables<double>& t_;
  int root_, places_ = 0;
  std::vector<Visit> visits_;
  std::vector<Carried> carried_;
  std::vector<Merge> merges_;
};

}  // namespace

Articulated articulated_bodies(const Tables<double>& t, TableStorage& storage) { return Paths(t).articulated(storage); }

namespace {

// Whether no stage needs the entries of A.
bool can_articulate(const Tables<double>& t) {
  return t.joints > 0 && t.reduction.followers == 0 && t.limited_servos.count == 0;
}

// The work to compute and factor A, to solve with it once, and to compute the rows' responses. Undamped rows do not
// count: a limit that is never reached may not change the result by a bit, so it may not change this choice.
long work_by_matrix(const Tables<double>& t) {
  long work = 0;
  for (int i = 0; i < t.matrix.n; ++i) {
    const long ancestors = t.matrix.row_start[i + 1] - t.matrix.row_start[i];
    if (i >= t.root_velocities()) {
      work += work::column_of_joint;
      if (t.matrix.parent[i] >= 0) work += work::column_past_body * t.matrix.size[i];
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
  long work = static_cast<long>(work::articulated_body) * t.joints;
  for (const Path& path : {a.all, a.all, a.rows})  // inwards, outwards, and the rows' responses
    for (int p = path.first; p < path.last; ++p)
      work += work::vector_past_body * (a.visits[p].last - a.visits[p].begin);
  return work;
}

}  // namespace

void take_articulated_bodies(Program& program) {
  Tables<double>& t = program.f64;
  if (!can_articulate(t)) return;
  const Articulated bodies = articulated_bodies(t, program.storage);
  if (work_by_bodies(t, bodies) < work_by_matrix(t)) t.articulated = bodies;
}

}  // namespace lockstep
