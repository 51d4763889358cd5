// Components: trees that couplings join. Each chooses how its inertia is made. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"
#include "plan/parts.h"

namespace lockstep {

std::vector<int> components(const Tables<double>& t) {
  Parts parts(t.tree.count);
  const auto tree_of_term = [&](int term) { return t.body[t.joint_body[t.term_joint[term]]].tree; };
  for (int c = 0; c < t.couplings; ++c)
    for (int k = t.term_start[c] + 1; k < t.term_start[c + 1]; ++k)
      parts.join(tree_of_term(t.term_start[c]), tree_of_term(k));
  for (int i = 0; i < t.spatial.tendons.count; ++i) {
    const SpatialTendon& tendon = t.spatial.tendons[i];
    for (int s = tendon.first; s < tendon.last; ++s)
      for (const int body : {t.spatial.segments[s].first_body, t.spatial.segments[s].second_body})
        if (body >= 0) parts.join(t.body[t.joint_body[tendon.joint]].tree, t.body[body].tree);
  }
  return parts.all();
}

void set_inertia(Program& program, const std::vector<bool>& trees, InertiaKind inertia) {
  Tables<double>& t = program.f64;
  std::vector<TreePlace<double>> places(t.tree.data, t.tree.data + t.tree.count);
  for (std::size_t i = 0; i < places.size(); ++i)
    if (trees[i]) places[i].inertia = inertia;
  t.tree = program.storage.keep(std::move(places));
}

std::vector<bool> trees_with(const Tables<double>& t, InertiaKind inertia) {
  std::vector<bool> trees(t.tree.count);
  for (int i = 0; i < t.tree.count; ++i) trees[i] = t.tree[i].inertia == inertia;
  return trees;
}

std::vector<int> trees_of_velocities(const Tables<double>& t) {
  std::vector<int> tree(t.velocities);
  for (int b = 0; b < t.bodies; ++b)
    std::fill_n(tree.begin() + t.body[b].velocity, t.body[b].root ? 6 : 1, t.body[b].tree);
  return tree;
}

}  // namespace lockstep
