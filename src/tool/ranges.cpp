// SPDX-License-Identifier: Apache-2.0
#include "ranges.h"

#include <algorithm>
#include <set>

namespace lockstep::tool {

std::vector<Range> held_ranges(const Plan& plan) {
  const std::set<std::string> rows(plan.row_names().begin(), plan.row_names().end());
  std::vector<Range> ranges(static_cast<std::size_t>(plan.dofs()));
  std::size_t dof = 0;
  for (const Joint& joint : plan.model().joints) {
    if (!joint.moves()) continue;
    if ((joint.kind != JointKind::tendon || is_hard(joint.limit_softness)) &&
        rows.count("position limit " + joint.name) > 0)
      ranges[dof] = {joint.lower, joint.upper, "", ""};
    ++dof;
  }
  return ranges;
}

std::vector<Range> usable_ranges(const Plan& plan) {
  const std::vector<Range> held = held_ranges(plan);
  std::vector<Range> usable = held;
  for (const int dof : plan.follower_dofs()) {
    const int leader = plan.leader(dof);
    if (leader < 0) continue;
    const Following& follows = plan.following(dof);
    if (follows.curved) continue;
    const double ratio = follows.leaders[0].ratio;
    double lower = (held[dof].lower - follows.offset) / ratio, upper = (held[dof].upper - follows.offset) / ratio;
    if (lower > upper) std::swap(lower, upper);
    Range& range = usable[leader];
    if (lower > range.lower) range.lower = lower, range.lower_by = plan.dof_names()[dof];
    if (upper < range.upper) range.upper = upper, range.upper_by = plan.dof_names()[dof];
  }
  return usable;
}

}  // namespace lockstep::tool
