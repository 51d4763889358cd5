// Which soft couplings are folded into A_r (M95), and where they stand in it. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "layout.h"

namespace lockstep {
namespace {

constexpr double largest_share = 1e3;  // (M97)

// Why no coupling of the program is folded; empty if some may be.
std::string common_obstacle(const Program& program) {
  if (program.integrator != Integrator::euler) return "an integrator with several stages has them as rows";
  if (declared(program, Parameter::softness)) return "the softness differs per environment";
  if (declared(program, Parameter::coupling_switch)) return "couplings are switched per environment";
  return "";
}

// Why a row keeps those of its component from being folded; empty if it does not.
std::string row_obstacle(const Program& program, int row, double share) {
  const Tables<double>& t = program.f64;
  const int c = t.rows.coupling[row];
  const std::string name = coupling_names(program.model)[static_cast<std::size_t>(c)];
  if (!t.rows.softness[row].soft) return fmt::format("coupling '{}' is hard", name);
  if (t.tree_of_joint(t.term_joint[t.term_start[c]]).inertia == InertiaKind::articulated_bodies)
    return fmt::format("coupling '{}' is on a tree that is solved by articulated bodies", name);
  if (!(share <= largest_share))
    return fmt::format("coupling '{}' is so stiff that the inertia of a joint would drown in single precision", name);
  return "";
}

}  // namespace

void choose_folding(Program& program, const std::function<std::vector<double>(const Program&)>& shares) {
  const Tables<double>& t = program.f64;
  if (program.method != Method::direct && program.method != Method::reduced) return;
  bool any_soft = declared(program, Parameter::softness) && t.rows.count > 0;
  for (int r = 0; r < t.rows.count; ++r) any_soft |= t.rows.softness[r].soft;
  if (!any_soft) return;
  program.folding_obstacle = common_obstacle(program);
  if (!program.folding_obstacle.empty()) return;
  narrow(program);
  const std::vector<double> share = shares(program);
  const std::vector<int> component = components(t);
  std::vector<std::string> obstacle(t.tree.count);  // by component
  const auto obstacle_beside = [&](int row) -> std::string& {
    return obstacle[component[t.body[t.joint_body[t.term_joint[t.term_start[t.rows.coupling[row]]]]].tree]];
  };
  for (int r = 0; r < t.rows.count; ++r)
    if (std::string& known = obstacle_beside(r); known.empty())
      known = row_obstacle(program, r, share[t.rows.coupling[r]]);
  for (int r = 0; r < t.rows.count; ++r) {
    if (obstacle_beside(r).empty())
      program.folded.push_back(t.rows.coupling[r]);
    else if (t.rows.softness[r].soft)
      program.folding_obstacle = obstacle_beside(r);
  }
}

void add_folded(const Program& program, const std::vector<std::vector<int>>& parts, Pattern& pattern) {
  const Tables<double>& t = program.f64;
  for (const int c : program.folded) {
    std::vector<int> moved;
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) {
      const std::vector<int>& part = parts[t.velocity_of(t.term_joint[k])];
      moved.insert(moved.end(), part.begin(), part.end());
    }
    for (const int a : moved)
      for (const int b : moved) pattern[std::max(a, b)][std::min(a, b)] = 1;
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
