// Which soft couplings are folded into A_r (M95), and where they stand in it. SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "plan/layout.h"

namespace lockstep {
void choose_folding(Program& program, const std::function<std::vector<double>(const Program&)>& shares) {
  const Tables<double>& t = program.f64;
  if (program.method != Method::direct && program.method != Method::reduced) return;

  // Whether there is something to fold, and nothing against all folding.
  bool any_soft = declared(program, Parameter::softness) && t.rows.count > 0;
  for (int r = 0; r < t.rows.count; ++r) any_soft |= t.rows.softness[r].soft;
  if (!any_soft) return;
  if (const auto obstacle = obstacle_to_folding(program)) return program.obstacles.push_back(*obstacle);

  // By component: the first row that stands in the way of the others.
  narrow(program);
  const std::vector<double> share = shares(program);
  const std::vector<int> component = components(t);
  std::vector<std::optional<PlanObstacle>> obstacle(t.tree.count);  // by component
  const auto obstacle_beside = [&](int row) -> std::optional<PlanObstacle>& {
    return obstacle[component[t.body[t.joint_body[t.term_joint[t.term_start[t.rows.coupling[row]]]]].tree]];
  };
  for (int r = 0; r < t.rows.count; ++r)
    if (auto& known = obstacle_beside(r); !known) known = obstacle_to_folding(program, r, share[t.rows.coupling[r]]);

  // Components without one are folded. Of the others the last reason is told.
  std::optional<PlanObstacle> told;
  for (int r = 0; r < t.rows.count; ++r) {
    if (!obstacle_beside(r))
      program.folded.push_back(t.rows.coupling[r]);
    else if (t.rows.softness[r].soft)
      told = obstacle_beside(r);
  }
  if (told) program.obstacles.push_back(*told);
}

void add_folded(const Program& program, const std::vector<std::vector<int>>& parts, Pattern& pattern) {
  const Tables<double>& t = program.f64;
  for (const int c : program.folded) {
    std::vector<int> moved;
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      const std::vector<int>& part = parts[t.velocity_of(t.term_joint[k])];
      moved.insert(moved.end(), part.begin(), part.end());
    }
    pattern.join_all(moved);
  }
}

void lay_out_folding(Program& program) {
  Tables<double>& t = program.f64;
  const Rows<double>& rows = t.folded;
  std::vector<int> entry;
  for (int r = 0; r < rows.count; ++r)
    for (int k = rows.term_start[r]; k < rows.term_start[r + 1]; ++k)
      for (int l = rows.term_start[r]; l <= k; ++l)
        entry.push_back(entry_of(t.solver, rows.term_index[k], rows.term_index[l]));
  t.folded_entry = program.storage.keep(std::move(entry));
  std::vector<int> coupling(t.rows.coupling.data, t.rows.coupling.data + t.rows.count);
  coupling.insert(coupling.end(), rows.coupling.data, rows.coupling.data + rows.count);
  t.impulse_coupling = program.storage.keep(std::move(coupling));
}

}  // namespace lockstep
