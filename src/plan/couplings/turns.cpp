// Joints that turn for ever, and the couplings whose offsets take up their turns. SPDX-License-Identifier: Apache-2.0
#include "plan/layout.h"

namespace lockstep {

void lay_out_turns(Program& program) {
  Tables<double>& t = program.f64;
  std::vector<int> turns(t.joints, 0), turning, coupling_turns(t.couplings, 0), couplings, placed;
  std::vector<SupportRun> turning_runs, other_runs;

  // Joints that turn: revolute ones without a range, but not those that a function has at an end. As a list, and as
  // runs beside those of the others.
  for (std::size_t j = 0; j < program.model.joints.size(); ++j) {
    const Joint& joint = program.model.joints[j];
    if (program.solver_joint[j] < 0) continue;
    turns[program.solver_joint[j]] = joint.kind != JointKind::prismatic && joint.kind != JointKind::tendon &&
                                     joint.kind != JointKind::ball && joint.lower == -infinity &&
                                     joint.upper == infinity;
  }
  for (int i = 0; i < t.functions.places.count; ++i) turns[t.functions.places[i].leader] = 0;
  for (int i = 0; i < t.functions.placing.count; ++i) turns[t.term_joint[t.term_start[t.functions.placing[i]]]] = 0;
  for (int j = 0; j < t.joints; ++j) {
    if (turns[j]) turning.push_back(j);
    std::vector<SupportRun>& own = turns[j] ? turning_runs : other_runs;
    if (own.empty() || own.back().last != j) own.push_back({j, j});
    ++own.back().last;
  }
  if (turning.empty()) return;

  // Couplings of such joints, and those among them that place a follower.
  for (int c = 0; c < t.couplings; ++c) {
    for (int k = t.term_start[c]; k < t.term_start[c + 1]; ++k) coupling_turns[c] |= turns[t.term_joint[k]];
    if (coupling_turns[c]) couplings.push_back(c);
  }
  for (int i = 0; i < t.reduction.placing.count; ++i)
    if (coupling_turns[t.reduction.placing[i]]) placed.push_back(t.reduction.placing[i]);

  t.exact_ratio = t.term_value;
  t.exact_offset = t.offset;
  t.turns = program.storage.keep(std::move(turns));
  t.turning = program.storage.keep(std::move(turning));
  t.turning_runs = program.storage.keep(std::move(turning_runs));
  t.other_runs = program.storage.keep(std::move(other_runs));
  t.coupling_turns = program.storage.keep(std::move(coupling_turns));
  t.turning_couplings = program.storage.keep(std::move(couplings));
  t.turning_placed = program.storage.keep(std::move(placed));
}

}  // namespace lockstep
