// The rows of the diagnostics, and their names. SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>

#include "plan/layout.h"

namespace lockstep {

void lay_out_report(Program& program) {
  Tables<double>& t = program.f64;
  const Bounds<double>& b = t.bounds;
  const auto add = [&](Reported row, const std::string& name) {
    program.reported.push_back(row);
    program.row_names.push_back(name);
  };
  // The bounded row of each kind that holds a joint or a coupling: the first one.
  std::map<std::pair<BoundKind, int>, int> bounded_rows;
  for (int r = 0; r < b.rows.count; ++r) {
    if (b.kind[r] == BoundKind::coupling) bounded_rows.emplace(std::pair(b.kind[r], b.rows.coupling[r]), r);
    for (int m = b.member_start[r]; m < b.member_start[r + 1]; ++m)
      bounded_rows.emplace(std::pair(b.kind[r], b.member[m].joint), r);
  }
  const auto bounded_row = [&](BoundKind kind, int index) {
    const auto row = bounded_rows.find({kind, index});
    return row == bounded_rows.end() ? -1 : row->second;
  };
  const auto places_in = [](const Span<int>& list, int count) {
    std::vector<int> places(static_cast<std::size_t>(count), -1);
    for (int i = 0; i < list.count; ++i) places[static_cast<std::size_t>(list[i])] = i;
    return places;
  };
  const std::vector<int> row_of_coupling = places_in(t.impulse_coupling, t.couplings),
                         limited_servo = places_in(t.limited_servos, t.joints);

  // Couplings, in the model's order.
  const std::vector<std::string> couplings = coupling_names(program.model);
  std::vector<double> hard(t.couplings, 0.0);
  for (int c = 0; c < t.couplings; ++c) {
    const Coupling& coupling = program.model.couplings[c];
    if (is_hard(coupling.softness)) hard[c] = erp_of(coupling.softness) / program.settings.dt;
    add({Reported::coupling, c, row_of_coupling[c], bounded_row(BoundKind::coupling, c),
         is_hard(coupling.softness) ? 1 : -1},
        "coupling " + couplings[c]);
  }

  // Loops, in the model's order.
  for (std::size_t l = 0; l < program.model.loops.size(); ++l)
    add({Reported::loop, static_cast<int>(l), -1, -1, -1}, "loop " + program.model.loops[l].name);

  // What bounds each joint has.
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const int i = program.solver_joint[j];
    if (i < 0) continue;
    const Joint& joint = program.model.joints[j];
    const auto joint_row = [&](Reported::Kind reported, const char* what, BoundKind bound) {
      add({reported, i, -1, bounded_row(bound, i), -1}, fmt::format("{} {}", what, joint.name));
    };
    const int has = b.has[i];
    const auto kind = [](bool hard) { return hard ? BoundKind::joint : BoundKind::soft_limit; };
    if (has_range_of(program, joint))
      joint_row(Reported::position_limit, "position limit",
                joint.kind == JointKind::ball ? BoundKind::ball_range : kind(is_hard(joint.limit_softness)));
    if (has & has_speed_limit) joint_row(Reported::velocity_limit, "velocity limit", BoundKind::joint);
    if (has & has_friction) joint_row(Reported::friction, "friction", BoundKind::joint);
    if (joint.drive.kinematic)
      joint_row(Reported::kinematic_drive, "kinematic drive",
                !is_hard(joint.drive.softness)          ? BoundKind::soft_drive
                : bounded_row(BoundKind::drive, i) >= 0 ? BoundKind::drive
                                                        : BoundKind::joint);
    if (t.effort_limit[i] < unlimited)
      add({Reported::effort_limit, i, -1, bounded_row(BoundKind::servo, i), limited_servo[i]},
          "effort limit " + joint.name);
  }

  if (program.settings.record_diagnostics) t.reported = program.storage.keep(program.reported);
  t.hard_rate = program.storage.keep(std::move(hard));
  std::vector<int> redundant(t.couplings, 0);
  for (int c : program.redundant) redundant[c] = 1;
  t.follows = program.storage.keep(std::move(redundant));
}

}  // namespace lockstep
