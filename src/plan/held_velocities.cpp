// Whether every bounded row and every limited servo acts on one velocity of the solver. SPDX-License-Identifier:
// Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "layout.h"

namespace lockstep {
namespace {

// Where the joint's velocity comes from; velocity -1 if it is the sum of several.
LimitedServo velocity_of(const Tables<double>& t, int joint) {
  const Reduction<double>& r = t.reduction;
  if (!r.used()) return {t.velocity_of(joint), -1, -1};
  if (const int f = r.follower_of[joint]; f >= 0)
    return r.start[f + 1] - r.start[f] == 1 ? LimitedServo{r.column[r.start[f]], r.start[f], f}
                                            : LimitedServo{-1, -1, -1};
  for (int z = 0; z < t.solver.n; ++z)
    if (r.independent[z] == t.velocity_of(joint)) return {z, -1, -1};
  return {-1, -1, -1};
}

}  // namespace

void choose_search(Program& program) {
  Tables<double>& t = program.f64;
  Bounds<double>& b = t.bounds;
  const Rows<double>& rows = b.rows;
  const auto refuse = [&](const std::string& reason) { program.search_obstacle = reason; };
  const bool stages = program.integrator == Integrator::leapfrog;
  if (program.method != Method::reduced && program.method != Method::direct)
    return refuse(fmt::format("{} visits bounds in its sweeps", to_string(program.method)));
  if (program.integrator != Integrator::euler && !stages) return;
  if (rows.count == 0 && t.limited_servos.count == 0 && !t.contacts.used()) return;
  if (t.rows.count > 0) return refuse("couplings that are not eliminated compete with the bounds");
  if (t.articulated.used()) return refuse("the bounds act on trees that are solved by articulated bodies");
  const auto name_of = [&](int joint) { return program.dof_names[static_cast<std::size_t>(t.dof[joint])]; };
  std::vector<std::string> several;
  std::vector<int> velocity, row_of(static_cast<std::size_t>(t.solver.n), -1);
  for (int r = 0; r < rows.count; ++r) {
    const int term = rows.term_start[r];
    if (b.kind[r] != BoundKind::joint) return refuse("a limit, a kinematic drive or a coupling's force limit is soft");
    if (rows.term_start[r + 1] - term != 1 || rows.term_value[term] != 1.0) {
      several.push_back(name_of(b.member[b.member_start[r]].joint));
      continue;
    }
    velocity.push_back(rows.term_index[term]);
    row_of[static_cast<std::size_t>(velocity.back())] = r;
  }
  std::vector<LimitedServo> servos;
  for (int i = 0; i < t.limited_servos.count; ++i) {
    servos.push_back(velocity_of(t, t.limited_servos[i]));
    if (servos.back().velocity < 0) several.push_back(name_of(t.limited_servos[i]));
  }
  if (!several.empty())
    return refuse(
        fmt::format("what has bounds or a limited servo follows several joints: {}", fmt::join(several, ", ")));
  b.by_velocity = true;
  b.always |= !servos.empty() && !stages;
  b.velocity = program.storage.keep(std::move(velocity));
  b.row_of = program.storage.keep(std::move(row_of));
  t.servo_velocities = program.storage.keep(std::move(servos));
}

}  // namespace lockstep
