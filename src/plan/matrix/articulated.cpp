// Articulated bodies instead of A, (M22) to (M25): paths of vectors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <functional>
#include <map>
#include <vector>

#include "plan/layout.h"
#include "plan/limits.h"

namespace lockstep {
namespace {

class Paths {
 public:
  // Velocities are those of the solver.
  Paths(const Tables<double>& t, const std::vector<bool>& trees)
      : t_(t), trees_(trees), velocity_(t.bodies, -1), body_(t.solver.n, -1), children_(t.bodies), arrived_(t.bodies) {
    std::vector<int> solver(t.velocities, -1);
    for (int z = 0; z < t.solver.n; ++z) solver[t.reduction.velocity_of(z)] = z;
    for (int b = 0; b < t.bodies; ++b) {
      const Body<double>& body = t.body[b];
      if (!trees[body.tree]) continue;
      velocity_[b] = solver[body.velocity];
      std::fill_n(body_.begin() + velocity_[b], body.root ? 6 : 1, b);
    }
    for (int b = t.bodies - 1; b >= 0; --b)
      if (t.body[b].parent >= 0) children_[t.body[b].parent].push_back(b);
  }

  // By body, from the last to the first: the vectors with an entry at its joint.
  using Moved = std::map<int, std::vector<int>, std::greater<>>;

  // The path of vectors side by side.
  Path path(const Moved& moved) {
    const int begin = static_cast<int>(visits_.size());
    std::vector<int> free;
    int taken = 0;
    for (const auto& [b, vectors] : moved) {
      // Vectors arrive from the children. Where two branches bring one, their wrenches are added.
      std::map<int, int>& known = arrived_[b];
      Visit visit{b, static_cast<int>(merges_.size()), 0, static_cast<int>(carried_.size()), 0, 0};
      for (const int child : children_[b]) {
        if (known.empty()) {
          known.swap(arrived_[child]);
          continue;
        }
        for (const auto& [vector, place] : arrived_[child]) {
          const auto [entry, is_new] = known.emplace(vector, place);
          if (is_new) continue;
          merges_.push_back({place, entry->second});
          free.push_back(place);
        }
      }

      // Vectors that begin here take a free place.
      std::map<int, int> starting;
      for (const int vector : vectors) {
        if (known.count(vector)) continue;
        starting[vector] = free.empty() ? taken++ : free.back();
        if (!free.empty()) free.pop_back();
      }

      // The visit: those that begin, then those that came. A root frees their places.
      const auto carry = [&](const std::map<int, int>& places) {
        for (const auto& [vector, place] : places) carried_.push_back({place, vector});
        return static_cast<int>(carried_.size());
      };
      visit.merge_last = static_cast<int>(merges_.size());
      visit.known = carry(starting);
      visit.last = carry(known);
      visits_.push_back(visit);
      known.insert(starting.begin(), starting.end());
      if (t_.body[b].parent >= 0) continue;
      for (const auto& [vector, place] : known) free.push_back(place);
    }
    for (const auto& [b, vectors] : moved) arrived_[b].clear();
    places_ = std::max(places_, taken);
    return {begin, static_cast<int>(visits_.size())};
  }

  // The path of the rows `first` to `last` - 1.
  Path path(const Rows<double>& rows, int first, int last) {
    Moved moved;
    for (int r = first; r < last; ++r)
      for (int i = rows.run_start[r]; i < rows.run_start[r + 1]; ++i)
        for (int z = rows.runs[i].first; z < rows.runs[i].last; ++z) {
          if (body_[z] < 0) continue;
          std::vector<int>& vectors = moved[body_[z]];
          if (vectors.empty() || vectors.back() != r - first) vectors.push_back(r - first);
        }
    return path(moved);
  }

  // Those by which the work of a step is judged: of all bodies, and of the rows.
  Articulated main_paths(TableStorage& storage) {
    Articulated a;
    Moved all;
    for (int b = 0; b < t_.bodies; ++b)
      if (trees_[t_.body[b].tree]) all[b] = {0};
    a.all = path(all);
    a.rows = path(t_.rows, 0, t_.rows.count);
    a.visits = storage.keep(visits_);
    return a;
  }

  Articulated articulated(TableStorage& storage) {
    Articulated a = main_paths(storage);
    std::vector<Path> bounds;
    for (int r = 0; r < t_.bounds.rows.count; ++r) bounds.push_back(path(t_.bounds.rows, r, r + 1));
    a.places = places_;
    a.velocity = storage.keep(velocity_);
    a.visits = storage.keep(visits_);
    a.carried = storage.keep(carried_);
    a.merges = storage.keep(merges_);
    a.bounds = storage.keep(std::move(bounds));
    a.root = make_columns({-1, 0, 1, 2, 3, 4}, storage);
    return a;
  }

 private:
  const Tables<double>& t_;
  const std::vector<bool>& trees_;
  int places_ = 0;
  std::vector<int> velocity_;  // by body: the first of its velocities
  std::vector<int> body_;      // by velocity
  std::vector<Visit> visits_;
  std::vector<Carried> carried_;
  std::vector<Merge> merges_;
  std::vector<std::vector<int>> children_;   // by body, from the last to the first
  std::vector<std::map<int, int>> arrived_;  // by body whose parent is still to be visited: place by vector
};

}  // namespace

namespace {

// Trees of components where no stage needs the entries of A.
std::vector<bool> can_articulate(const Program& program, const std::vector<int>& component) {
  const Tables<double>& t = program.f64;
  std::vector<char> moves(t.tree.count, 0), needs(t.tree.count, 0);  // by component
  const auto component_of_joint = [&](int j) { return component[t.body[t.joint_body[j]].tree]; };
  for (int j = 0; j < t.joints; ++j) moves[component_of_joint(j)] = 1;
  for (int f = 0; f < t.reduction.followers; ++f) needs[component_of_joint(t.reduction.follower[f])] = 1;
  for (int r = 0; r < t.folded.count; ++r)
    needs[component_of_joint(t.term_joint[t.term_start[t.folded.coupling[r]]])] = 1;
  for (const int joint : program.limited_servos) needs[component_of_joint(joint)] = 1;
  std::vector<bool> trees(t.tree.count);
  for (int i = 0; i < t.tree.count; ++i) trees[i] = moves[component[i]] && !needs[component[i]];
  return trees;
}

// By component, the work to compute and factor A, to solve with it once, and to compute the rows' responses. Undamped
// rows do not count: a limit that is never reached may not change the result by a bit, so it may not change this
// choice.
std::vector<long> work_by_matrix(const Tables<double>& t, const std::vector<int>& component) {
  std::vector<long> work(t.tree.count, 0);
  const std::vector<int> tree = trees_of_velocities(t);
  for (int i = 0; i < t.matrix.n; ++i) {
    const long ancestors = t.matrix.row_start[i + 1] - t.matrix.row_start[i];
    work[component[tree[i]]] += (ancestors + 2) * t.matrix.size[i];
  }
  for (int j = 0; j < t.joints; ++j) {
    const int i = t.velocity_of(j);
    work[component[tree[i]]] +=
        work::column_of_joint + (t.matrix.parent[i] >= 0 ? work::column_past_body * t.matrix.size[i] : 0);
  }
  for (int g = 0; g < t.rows.groups.count; ++g) {
    const RowGroup& group = t.rows.groups[g];
    for (int s = group.support_first; s < group.support_last; ++s) {
      const SupportRange range = t.rows.group_support[s];
      const int i = t.reduction.velocity_of(range.index);
      work[component[tree[i]]] += static_cast<long>(group.count) * (range.end - range.index);
    }
  }
  return work;
}

// By component. `paths` are those of all trees.
std::vector<long> work_by_bodies(const Tables<double>& t, const Articulated& paths, const std::vector<int>& component) {
  std::vector<long> work(t.tree.count, 0);
  for (int j = 0; j < t.joints; ++j) work[component[t.body[t.joint_body[j]].tree]] += work::articulated_body;
  for (const Path& path : {paths.all, paths.all, paths.rows})  // inwards, outwards, and the rows' responses
    for (int p = path.first; p < path.last; ++p)
      work[component[t.body[paths.visits[p].body].tree]] +=
          work::vector_past_body * (paths.visits[p].last - paths.visits[p].begin);
  return work;
}

}  // namespace

void take_articulated_bodies(Program& program) {
  Tables<double>& t = program.f64;
  const std::vector<int> component = components(t);
  std::vector<bool> trees = can_articulate(program, component);
  const std::vector<long> by_matrix = work_by_matrix(t, component);
  const std::vector<long> by_bodies = work_by_bodies(t, Paths(t, trees).main_paths(program.storage), component);
  for (int i = 0; i < t.tree.count; ++i) trees[i] = trees[i] && by_bodies[component[i]] < by_matrix[component[i]];
  set_inertia(program, trees, InertiaKind::articulated_bodies);
}

void lay_out_factoring(Program& program) {
  Tables<double>& t = program.f64;
  const std::vector<bool> trees = trees_with(t, InertiaKind::articulated_bodies);
  const std::vector<int> tree = trees_of_velocities(t);
  const auto articulated = [&](int z) { return trees[tree[t.reduction.velocity_of(z)]]; };

  // Velocities that are factored by columns.
  std::vector<SupportRun> factored;
  for (int z = 0; z < t.solver.n; ++z) {
    if (articulated(z)) continue;
    if (!factored.empty() && factored.back().last == z)
      ++factored.back().last;
    else
      factored.push_back({z, z + 1});
  }
  t.factored = program.storage.keep(std::move(factored));

  // Trees with undamped rows, whose A is computed however they are solved.
  std::vector<TreePlace<double>> places(t.tree.data, t.tree.data + t.tree.count);
  std::vector<SupportRun> undamped;
  for (TreePlace<double>& place : places) place.has_undamped_rows = false;
  for (int i = 0; i < t.undamped.support.count; ++i) places[tree[t.undamped.support[i].index]].has_undamped_rows = true;
  for (int i = 0; i < t.velocities; ++i) {
    if (!places[tree[i]].has_undamped_rows) continue;
    if (!undamped.empty() && undamped.back().last == i)
      ++undamped.back().last;
    else
      undamped.push_back({i, i + 1});
  }
  t.undamped_velocities = program.storage.keep(std::move(undamped));
  t.makes_matrix = std::any_of(places.begin(), places.end(), [](const TreeStructure& place) {
    return place.inertia == InertiaKind::matrix || place.has_undamped_rows;
  });
  if (t.makes_matrix) require_room(program, t.matrix.entries, the_mass_matrix);
  t.tree = program.storage.keep(std::move(places));

  // Groups of rows whose responses go along paths.
  std::vector<RowGroup> groups(t.rows.groups.data, t.rows.groups.data + t.rows.groups.count);
  for (RowGroup& group : groups)
    group.articulated = t.tree_of_joint(t.term_joint[t.term_start[t.rows.coupling[group.first]]]).inertia ==
                        InertiaKind::articulated_bodies;
  t.rows.groups = program.storage.keep(std::move(groups));
  if (std::find(trees.begin(), trees.end(), true) != trees.end())
    t.articulated = Paths(t, trees).articulated(program.storage);
}

}  // namespace lockstep
