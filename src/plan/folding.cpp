// Which soft couplings are folded into A_r (M95), and where they stand in it. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "layout.h"

namespace lockstep {
namespace {

constexpr double largest_share = 1e3;  // (M97)

bool is_soft(const Program& program, int row) {
  return program.f64.rows.softness[row].soft || declared(program, Parameter::softness);
}

}  // namespace

void choose_folding(Program& program, const std::function<std::vector<double>(const Program&)>& shares) {
  const Tables<double>& t = program.f64;
  if (program.method != Method::direct && program.method != Method::reduced) return;
  bool any_soft = false;
  for (int r = 0; r < t.rows.count; ++r) any_soft |= is_soft(program, r);
  if (!any_soft) return;
  const std::vector<std::string> names = coupling_names(program.model);
  const auto refuse = [&](const std::string& reason) { program.folding_obstacle = reason; };
  if (program.integrator != Integrator::euler) return refuse("an integrator with several stages has them as rows");
  if (declared(program, Parameter::softness)) return refuse("the softness differs per environment");
  if (declared(program, Parameter::coupling_switch)) return refuse("couplings are switched per environment");
  for (int r = 0; r < t.rows.count; ++r) {
    const int c = t.rows.coupling[r];
    if (!is_soft(program, r)) return refuse(fmt::format("coupling '{}' is hard", names[c]));
    if (t.tree_of_joint(t.term_joint[t.term_start[c]]).inertia == InertiaKind::articulated_bodies)
      return refuse(fmt::format("coupling '{}' is on a tree that is solved by articulated bodies", names[c]));
  }
  narrow(program);
  const std::vector<double> share = shares(program);
  for (int r = 0; r < t.rows.count; ++r)
    if (const int c = t.rows.coupling[r]; !(share[c] <= largest_share))
      return refuse(fmt::format("coupling '{}' is so stiff that the inertia of a joint would drown in single precision",
                                names[c]));
  program.folded.assign(t.rows.coupling.data, t.rows.coupling.data + t.rows.count);
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
}

}  // namespace lockstep
